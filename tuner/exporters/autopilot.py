"""Parameters of autopilots: which are loaded, and which keep the stock value, each with the reason."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from tuner.exporters.triad_values import Figure
from tuner.exporters.withheld import AutopilotSetting, keep_stock
from tuner.types import FilterConfig


@dataclass(frozen=True)
class Parameter:
    """A parameter of an autopilot: what it is made from, the range its ground stations show, and the stock value.

    The firmware takes any value from 0 to 1 as it is; the range is advice.
    """

    sensor: str
    setting: AutopilotSetting
    low: float
    high: float
    stock: float

    def remark(self, value: float) -> str:
        """Return the remark on a value: the stock one, and a warning where it is outside the range."""
        stock = f"stock {self.stock:g}"
        if self.low <= value <= self.high:
            return stock
        return (
            f"{stock}; WARNING outside {self.low:g} … {self.high:g}, which ground stations show as the range: "
            "the firmware takes it as it is"
        )


def loaded(
    figures: Mapping[str, Figure], parameters: Mapping[str, Parameter], config: FilterConfig
) -> dict[str, float]:
    """Return the values of the parameters that are loaded, by name; all others keep their stock value."""
    return {
        name: figure.value for name, figure in figures.items() if not _kept(parameters[name], figure, config)
    }


def given(values: Mapping[str, float], parameters: Mapping[str, Parameter]) -> list[str]:
    """Return the sensors whose white noise and walk are both loaded."""
    pairs = {(one.sensor, one.setting) for name, one in parameters.items() if name in values}
    return [one for one in dict(pairs) if {(one, "white"), (one, "walk")} <= pairs]


def parameter_lines(
    figures: Mapping[str, Figure], parameters: Mapping[str, Parameter], config: FilterConfig, release: str
) -> Iterator[str]:
    """Yield a comment line for each parameter, which keeps its stock value or is loaded, and where stock is from."""
    yield f"stock values: {release}"
    for name, figure in figures.items():
        declared = parameters[name]
        if why := _kept(declared, figure, config):
            yield f"{name}: keep stock {declared.stock:g}: {why}; here {figure.value:.4g} {figure.note}"
        else:
            yield f"{name}: {figure.note}; {declared.remark(figure.value)}"
    if len(loaded(figures, parameters, config)) < len(figures):
        yield "`tuner tune LOG --drive DRIVE` measures what motion adds; with it, more than stock can be judged"


def _kept(declared: Parameter, figure: Figure, config: FilterConfig) -> str | None:
    return keep_stock(config, declared.sensor, declared.setting, figure.value, declared.stock)
