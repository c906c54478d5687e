"""Named declarations of one kind: the built-in ones, and those of other packages.

A noise term, a cause, a dialect, a reader or a filter state is declared once. Everything that has to know all of one
kind uses its `Registry`, which maps names to declarations. Another package adds its own by an entry point in its
``pyproject.toml``::

    [project.entry-points."tuner.noise_terms"]
    second_order_gauss_markov = "my_package.noise:SecondOrderGaussMarkov"

or, within one process such as a notebook, by `Registry.add`. Entry points are loaded when the registry is first
given a name it does not have, or for all of its names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

T = TypeVar("T")


class RegistryError(ValueError):
    """A name that is not declared, is declared twice, or whose package cannot be loaded; the message is one line."""


class Registry(Mapping[str, T]):
    """Declarations of one kind by name, in the order in which they were declared.

    Parameters
    ----------
    kind : str
        What is declared, in words for messages, such as ``noise term``.
    group : str
        Entry-point group in which other packages declare theirs, such as ``tuner.noise_terms``.
    name_of : callable
        Returns the name of a declaration.
    check : callable, optional
        Raises ValueError or TypeError where a declaration is not complete; called before anything is added.
    declared_by : callable, optional
        Takes the declaration out of what an entry point names, where several registries share a group; None where
        that has none for this registry.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        *,
        name_of: Callable[[T], str],
        check: Callable[[T], None] | None = None,
        declared_by: Callable[[Any], T | None] | None = None,
    ) -> None:
        self.kind = kind
        self.group = group
        self._name_of = name_of
        self._check = check
        self._declared_by = declared_by
        self._declared: dict[str, T] = {}
        self._entry_points_loaded = False

    def add(self, declaration: T) -> T:
        """Add a declaration and return it, so that a class can be decorated with it.

        Raises
        ------
        RegistryError
            Where the name is taken by another declaration, or the declaration is not complete.
        """
        try:
            name = self._name_of(declaration)
        except AttributeError:
            raise RegistryError(
                f"{self.kind}: a declaration must state its name, got {declaration!r}"
            ) from None
        if self._declared.get(name, declaration) is not declaration:
            raise RegistryError(f"{self.kind} '{name}' is declared twice; give one of the two another name")
        if self._check is not None:
            try:
                self._check(declaration)
            except (TypeError, ValueError) as error:
                raise RegistryError(f"{self.kind} '{name}': {error}") from error
        self._declared[name] = declaration
        return declaration

    def extend(self, declarations: Iterable[T]) -> None:
        """Add several declarations."""
        for declaration in declarations:
            self.add(declaration)

    @contextmanager
    def added(self, declaration: T) -> Iterator[T]:
        """Hold a declaration for the length of a ``with`` block, as tests need it."""
        name = self._name_of(declaration)
        self.add(declaration)
        try:
            yield declaration
        finally:
            del self._declared[name]

    def __getitem__(self, name: str) -> T:
        if name not in self._declared:
            self._load_entry_points()
        if name not in self._declared:
            raise RegistryError(self.unknown(name))
        return self._declared[name]

    def get(self, name: str, default: T | None = None) -> T | None:  # type: ignore[override]
        """Return a declaration, or `default` where the name is not declared."""
        if name not in self:
            return default
        return self[name]

    def __contains__(self, name: object) -> bool:
        if name not in self._declared:
            self._load_entry_points()
        return name in self._declared

    def __iter__(self) -> Iterator[str]:
        self._load_entry_points()
        return iter(tuple(self._declared))

    def __len__(self) -> int:
        self._load_entry_points()
        return len(self._declared)

    def unknown(self, name: object) -> str:
        """Return the line that says that a name is not declared, and which are."""
        close = get_close_matches(str(name), list(self), n=1)
        close = close or [known for known in self if known and str(name).lower().startswith(known.lower())]
        meant = f" (did you mean '{close[0]}'?)" if close else ""
        return f"unknown {self.kind} '{name}'{meant}; known are {', '.join(self)}"

    def _load_entry_points(self) -> None:
        if self._entry_points_loaded:
            return
        for point in entry_points(group=self.group):
            declaration = self._loaded(point)
            if declaration is not None:
                self.add(declaration)
        self._entry_points_loaded = True

    def _loaded(self, point: EntryPoint) -> T | None:
        package = point.dist.name if point.dist is not None else "another package"
        try:
            named: Any = point.load()
            declaration: T | None = named if self._declared_by is None else self._declared_by(named)
        except Exception as error:
            raise RegistryError(
                f"{self.kind} '{point.name}' of package '{package}' cannot be loaded "
                f"({type(error).__name__}: {error}); mend or uninstall that package"
            ) from error
        return declaration
