"""Step 3: score one answer against its ground truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

FAMILIES = (
    frozenset({"temperature", "thermal_lag", "thermal", "warmup"}),
    frozenset({"lowpass", "colour"}),
    frozenset({"heavy_tails", "spikes"}),
    frozenset({"time_offset", "velocity_lag"}),
    frozenset({"correlated_gnss", "gnss_noise_scale"}),
)
"""Causes that count half where one stands for the other."""
EXACT = frozenset({"timing", "lattice", "motion"})
"""Causes that need no statistics; their detectability is not a measure."""
BANDS = {"sub": (0.0, 8.0), "threshold": (8.0, 35.0), "clear": (35.0, 100.0), "strong": (100.0, float("inf"))}


@dataclass(frozen=True)
class Parameter:
    """One parameter of one axis: truth, estimate, whether the 95 % interval holds the truth."""

    cause: str
    name: str
    nats: float
    truth: float
    value: float
    inside: bool


@dataclass(frozen=True)
class Verdict:
    """What an answer is worth.

    Attributes
    ----------
    name, kind, hard : str
        Of the item.
    causes : tuple of str
        Hidden, the clearest first.
    nats : tuple of float
        Their detectability.
    twins : tuple of str
        Their stated twins.
    findings : tuple of str
        Causes found, in the order told.
    shortlists : dict of str to tuple of str
        Alternatives by the cause they stand beside.
    unexplained : tuple of str
        Statistics that alarmed without a cause.
    stray : int
        Right causes told of axes that do not have them.
    gains : dict of str to float
        Nats on the record held out, by cause.
    """

    name: str
    kind: str
    hard: str
    samples: int
    axes: int
    causes: tuple[str, ...]
    nats: tuple[float, ...]
    twins: tuple[str, ...]
    findings: tuple[str, ...]
    shortlists: dict[str, tuple[str, ...]]
    unexplained: tuple[str, ...]
    stray: int
    parameters: tuple[Parameter, ...]
    gains: dict[str, float]
    seconds: float
    cpu: float
    error: str | None = field(default=None)

    @property
    def band(self) -> str:
        """Band of the clearest cause."""
        return next(name for name, (low, high) in BANDS.items() if low <= max(self.nats) < high)

    @property
    def alarm(self) -> bool:
        """Whether anything was said."""
        return bool(self.findings or self.unexplained)

    @property
    def named(self) -> bool:
        """Whether every hidden cause has its name, the first of them first."""
        return (
            bool(self.findings) and self.findings[0] in self.causes and set(self.causes) <= set(self.findings)
        )

    @property
    def listed(self) -> bool:
        """Whether the first cause stands in a shortlist of two at most."""
        return any(self.causes[0] in names and len(names) < 3 for names in self.shortlists.values())

    @property
    def familial(self) -> bool:
        """Whether a cause of the same family was named."""
        return any({self.causes[0], told} <= family for family in FAMILIES for told in self.findings)

    @property
    def extra(self) -> int:
        """Findings that are not in the key."""
        return sum(told not in self.causes for told in self.findings)

    def points(self) -> float:
        """Return the score of EFFECTS: found 1, named 2, parameters 1, gain 1, quiet 1, false finding −2."""
        if not self.causes:
            return -4.0 if self.alarm else 2.0
        if self.kind == "unknown":
            return 3.0 if self.unexplained and not self.findings else -2.0 * len(self.findings)
        total = -2.0 * self.extra + (1.0 if self.alarm else 0.0)
        if self.named:
            total += 2.0
        elif self.listed:
            total += 1.5
        elif self.familial:
            total += 1.0
        inside = [p.inside for p in self.parameters]
        total += sum(inside) / len(inside) if inside else 0.0
        total += 1.0 if self.gains and min(self.gains.values()) > 0 else 0.0
        return total + (1.0 if self.alarm and not self.unexplained else 0.0)


def judge(truth: dict[str, Any], answer: dict[str, Any]) -> Verdict:
    """Hold one answer against its key."""
    hidden = sorted(truth["effects"], key=lambda effect: -effect["nats"])
    findings = answer["findings"]
    parameters: list[Parameter] = []
    stray = 0
    for effect in hidden:
        for finding in (f for f in findings if f["cause"] == effect["cause"]):
            stray += len(set(finding["channels"]) - set(effect["axes"])) > 0
            parameters += _parameters(effect, finding)
    return Verdict(
        name=truth["name"],
        kind=truth["kind"],
        hard=truth["scene"]["hard"],
        samples=truth["scene"]["samples"],
        axes=len(truth["scene"]["axes"]),
        causes=tuple(effect["cause"] for effect in hidden),
        nats=tuple(effect["nats"] for effect in hidden),
        twins=tuple(effect["twin"] for effect in hidden if effect["twin"]),
        findings=tuple(dict.fromkeys(finding["cause"] for finding in findings)),
        shortlists={
            f["cause"]: tuple(a["cause"] for a in f["alternatives"]) for f in findings if f["alternatives"]
        },
        unexplained=tuple(u["statistic"] for u in answer["unexplained"]),
        stray=stray,
        parameters=tuple(parameters),
        gains={
            f["cause"]: f["gain"]["nats"] for f in findings if f.get("gain") and f["gain"]["nats"] is not None
        },
        seconds=answer["seconds"],
        cpu=answer["cpu"],
        error=answer["error"],
    )


def _parameters(effect: dict[str, Any], finding: dict[str, Any]) -> list[Parameter]:
    out = []
    for axis, truths in effect["parameters"].items():
        if axis not in finding["channels"]:
            continue
        told = finding["by_channel"].get(axis) or finding["parameters"]
        for name, true in truths.items():
            figure = told.get(name)
            true = true[0] if isinstance(true, list) else true
            if not isinstance(figure, dict) or figure.get("value") is None or figure.get("interval") is None:
                continue
            low, high = figure["interval"]
            slack = 1e-9 * abs(true)
            out.append(
                Parameter(
                    effect["cause"],
                    name,
                    effect["nats"],
                    true,
                    figure["value"],
                    low - slack <= true <= high + slack,
                )
            )
    return out
