# mypy: disable-error-code="no-untyped-call, untyped-decorator, misc"
"""How kernels are compiled: the parts as they are written, and a kernel with all of its parts at once.

By itself numba optimises every function that a kernel calls and turns it into instructions, and does both again
in each caller. Here a part waits for its kernel, and the kernel is optimised with it.
"""

from __future__ import annotations

import gc
import logging
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.event import Listener, register
from numba.core.typed_passes import NativeLowering
from numba.extending import register_jitable

from tuner.navigation.engine.simd import ALIGNMENT

Function = TypeVar("Function", bound=Callable[..., object])


class _Part(JITCodeLibrary):
    """The code of a part, as it is written."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def add_ir_module(self, module: Any) -> None:
        """Add code; lanes on its stack lie where wide loads are fast."""
        for function in module.functions:
            if function.blocks:
                function.attributes.alignstack = ALIGNMENT
                function.attributes.add("nounwind")  # alone, the other is not written
        super().add_ir_module(module)

    def finalize(self) -> None:
        """Leave everything to the kernel; what is nowhere called may go."""
        for function in self._final_module.functions:
            if not function.is_declaration:
                function.linkage = "linkonce_odr"
        self._shared_module = self._final_module
        self._finalize_dynamic_globals()
        self._finalized = True


class _Whole(_Part):
    """The code of a kernel."""

    def add_linking_library(self, library: Any) -> None:
        """Link a part, and the parts of it."""
        super().add_linking_library(library)
        if isinstance(library, _Part):
            for part in library._linking_libraries:
                self.add_linking_library(part)

    def finalize(self) -> None:
        """Link, optimise and turn into instructions."""
        JITCodeLibrary.finalize(self)

    def _optimize_final_module(self) -> None:
        for level in (1, 3):  # what the first leaves behind, the second makes a fifth faster
            passes, builder = self._codegen._module_pass_manager(
                opt=level, loop_vectorize=False, slp_vectorize=False
            )
            passes.run(self._final_module, builder)


@register_pass(mutates_CFG=True, analysis_only=False)
class _WriteWhole(NativeLowering):
    """Writes the code of a kernel."""

    _name = "write_whole"

    def run_pass(self, state: Any) -> bool:
        """Put it into a library that is kept on disk."""
        state.library = _Whole(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class _WritePart(NativeLowering):
    """Writes the code of a part."""

    _name = "write_part"

    def run_pass(self, state: Any) -> bool:
        """Let callers find it by a function that has no address."""
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        written = state["cr"]
        module, name = written.fndesc.lookup_module(), state.func_id.func_name
        entry = _dynfunc.make_function(module, name, "", 0, written.env, (state.library,))
        state.targetctx.insert_user_function(entry, written.fndesc, [state.library])
        state["cr"] = written._replace(cfunc=entry)
        return True


def _compiler(writes: type[NativeLowering]) -> type[CompilerBase]:
    """Return numba's compiler with another pass that writes code."""

    class Compiler(CompilerBase):
        def define_pipelines(self) -> Any:
            """Return what is done one after the other."""
            steps = DefaultPassBuilder.define_nopython_pipeline(self.state)
            steps.passes = [(writes if s is NativeLowering else s, why) for s, why in steps.passes]
            steps.finalize()
            return [steps]

    return Compiler


_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": True,
    "no_cfunc_wrapper": True,
    "_nrt": False,  # nothing is allocated, and who calls owns all arrays: none are counted
}
PART: Any = _OPTIONS | {"no_cpython_wrapper": True, "pipeline_class": _compiler(_WritePart)}
"""What numba is to know of a part."""


def kernel(function: Function) -> Function:
    """Make a kernel, kept on disk; when it has to be compiled, a line on standard error says so."""
    made: Function = numba.njit(cache=True, nogil=True, pipeline_class=_compiler(_WriteWhole), **_OPTIONS)(
        function
    )
    _ANNOUNCER.kernels.add(made)
    return made


def compiled(function: Function) -> Function:
    """Make a part of kernels, with numbers or lanes; one without loops is better `straight`."""
    return _part(function, within=True)


def called(function: Function) -> Function:
    """Make a part that is called seldom, and so there once, not again within each caller."""
    return _part(function, within=False)


def _part(function: Function, *, within: bool) -> Function:
    made: Function = register_jitable(**PART, forceinline=within)(function)
    return made


class _Announcer(Listener):
    """Says, on standard error unless the log is turned elsewhere, that kernels are being compiled.

    Meanwhile no garbage is collected: there is little, and looking for it takes an eighth of the time.
    """

    def __init__(self) -> None:
        self.kernels: set[object] = set()
        self.collects = False

    def on_start(self, event: Any) -> None:
        """Speak where a kernel that is kept on disk was not found there."""
        if event.data["dispatcher"] in self.kernels:
            logging.getLogger("tuner").warning(
                "tuner: compiling the filter for this machine, once; it takes some ten seconds"
            )
            self.collects = gc.isenabled()
            gc.disable()

    def on_end(self, event: Any) -> None:
        """Collect again."""
        if event.data["dispatcher"] in self.kernels and self.collects:
            gc.enable()


_ANNOUNCER = _Announcer()
register("numba:compile", _ANNOUNCER)
