"""What a simulation gets wrong: named causes, their parameters, and what naming them gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from models.noise import NoiseModel
from tuner.types.coefficient import Coefficient
from tuner.types.compensation import Compensation
from tuner.types.config import FilterConfig
from tuner.types.inflation import Enlargement
from tuner.types.shown import Shown


@dataclass(frozen=True)
class Gain:
    """What an extension of the model is worth, before and after.

    Attributes
    ----------
    split : str
        Where it was measured: ``second record``, ``60/40`` or ``in sample``.
    before, after : float
        Log likelihood a sample of the data held out, nats.
    nats : float
        Log likelihood gained there, all samples together.
    coverage : mapping of str to (float, float)
        Share of the Allan curve (``allan``) and of the spectrum (``psd``) inside the band of refitted replicas.
    user : mapping of str to (float, float)
        Figures a user reads, with their unit in the name, such as ``bias_prediction_60s [rad/s]``.
    """

    split: str
    before: float
    after: float
    nats: float
    coverage: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    user: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def contradicts(self) -> bool:
        """Whether data that had no part in the fit are less likely with the extension."""
        return self.nats < 0.0 and self.split != "in sample"


@dataclass(frozen=True)
class Alternative:
    """A cause that explains a rejected test nearly as well; `score` is its weight, 1 for as well as the cause named."""

    cause: str
    score: float


@dataclass(frozen=True)
class Finding:
    """One cause of a misfit between data and simulation.

    Attributes
    ----------
    cause : str
        Code of the catalogue, such as ``temperature``.
    channels : tuple of str
        Axes that show it.
    statistic : str
        What gave it away, in words.
    value : float
        Value of that statistic.
    p_value : float
        Chance of such a value without the cause, the search paid for.
    parameters : mapping of str to Coefficient
        SI. Of several channels: pooled where they agree, else those of the channel that shows it best.
    text : str
        The cause in words, with its figures.
    consequence : str
        What it means for a filter.
    extension : mapping of str to object
        What was added to the model, as plain values.
    gain : Gain or None
        What that is worth.
    alternatives : tuple of Alternative
        Causes within 3 nats.
    inflations : tuple of Enlargement
        Settings to be enlarged for it.
    by_channel : mapping of str to mapping
        Parameters of every channel.
    drift : mapping of str to (float, float)
        Position error, m, after so long without fixes (``60 s``), with the cause in the samples and without it; of a
        static log.
    doubted : tuple of str
        Parameters that the data do not determine, such as an estimate at its bound: not shown, and in no setting.
    """

    cause: str
    channels: tuple[str, ...]
    statistic: str
    value: float
    p_value: float
    parameters: Mapping[str, Coefficient]
    text: str
    consequence: str = ""
    extension: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    gain: Gain | None = None
    alternatives: tuple[Alternative, ...] = ()
    inflations: tuple[Enlargement, ...] = ()
    by_channel: Mapping[str, Mapping[str, Coefficient]] = field(default_factory=lambda: MappingProxyType({}))
    drift: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    doubted: tuple[str, ...] = ()

    @property
    def in_motion(self) -> str:
        """What it does to samples in motion, in words; empty for nothing known."""
        return str(self.extension.get("in_motion", ""))

    @property
    def figures(self) -> Mapping[str, Coefficient]:
        """Its parameters without those that are doubted: what an answer shows."""
        return {name: one for name, one in self.parameters.items() if name not in self.doubted}

    @property
    def determined(self) -> bool:
        """Whether one of its figures is determined, so that it may name a cause; without figures its test decides."""
        return not self.parameters or any(one.determined for one in self.parameters.values())

    def of_each(self, name: str) -> Mapping[str, Coefficient]:
        """Return a parameter of every channel where it is not the same in all; empty where one value serves."""
        return of_each(name, self.parameters[name], self.by_channel)


def of_each(
    name: str, shown: Coefficient, by_channel: Mapping[str, Mapping[str, Coefficient]]
) -> Mapping[str, Coefficient]:
    """Return a parameter of every channel where that shown is of one of them alone; empty where it is pooled."""
    each = {axis: values[name] for axis, values in by_channel.items() if name in values}
    return each if len(each) > 1 and list(each.values()).count(shown) == 1 else {}


START = "start"
"""What an unexplained test is about where the start of a drive failed."""


@dataclass(frozen=True)
class Unexplained:
    """A rejected test that no cause explains.

    Attributes
    ----------
    statistic : str
        What rejects, in words.
    channels : tuple of str
        Axes that show it.
    p_value : float
        Chance of it where the model is right, the search paid for.
    nats : float
        Size: log likelihood that the best description of what is left gains on the model; 0 where it is not known.
    place : str
        Where it shows most: time, frequency, or the whole record.
    drift : mapping of str to (float, float)
        Position error, m, after so long without fixes (``60 s``), as the axis shows it, what was found taken out, and
        as its model has it; of a static log.
    about : str
        What of the samples it is about: ``fast spectrum``, ``distribution`` or ``slow part``; of a drive `START` where
        its start failed, else empty.
    """

    statistic: str
    channels: tuple[str, ...]
    p_value: float
    nats: float = 0.0
    place: str = ""
    drift: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    about: str = ""

    @property
    def part(self) -> str:
        """What of the samples it is about, where that is not said the statistic."""
        return self.about or self.statistic


def only_determined(
    findings: tuple[Finding, ...], unexplained: tuple[Unexplained, ...]
) -> tuple[tuple[Finding, ...], tuple[Unexplained, ...]]:
    """Return findings and what is unexplained, causes without a determined figure among the latter."""
    left = [one for one in findings if not one.determined]
    return tuple(one for one in findings if one.determined), (
        *(
            Unexplained(f"{one.cause.replace('_', ' ')} of undetermined size", one.channels, one.p_value)
            for one in left
        ),
        *unexplained,
    )


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """What the simulation of the base model gets wrong.

    Attributes
    ----------
    findings : tuple of Finding
        Named causes, the clearest first.
    unexplained : tuple of Unexplained
        Rejected tests without a cause.
    notes : tuple of str
        What is worth knowing and harmless.
    models : mapping of str to NoiseModel
        Extended noise model of every axis, SI.
    base : mapping of str to NoiseModel
        Noise model before.
    parts : mapping of str to (float, float)
        Begin and end, s, of what was analysed of an axis, where the sensor moved in too much of the log for the whole.
    left_out : tuple of (float, float)
        Begin and end, s, of what tells nothing of the noise at rest: motion, what is about it, and what is between.
    """

    findings: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...] = ()
    notes: tuple[str, ...] = ()
    models: Mapping[str, NoiseModel] = field(default_factory=lambda: MappingProxyType({}))
    base: Mapping[str, NoiseModel] = field(default_factory=lambda: MappingProxyType({}))
    parts: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    left_out: tuple[tuple[float, float], ...] = ()

    @property
    def quiet(self) -> bool:
        """Whether nothing was found."""
        return not self.findings and not self.unexplained

    @property
    def inflations(self) -> tuple[Enlargement, ...]:
        """Settings of a filter to be enlarged."""
        return tuple(inflation for finding in self.findings for inflation in finding.inflations)


@dataclass(frozen=True)
class Inseparable:
    """Causes that pull the innovations of a drive the same way, and what would tell them apart."""

    causes: tuple[str, ...]
    text: str


@dataclass(frozen=True)
class NoiseScaleEstimate:
    """True ÷ stated size of one noise setting as a drive shows it, without and with the findings in the filter.

    Attributes
    ----------
    setting : str
        ``gyro_white``, ``accel_white``, ``gyro_bias``, ``accel_bias``, ``position`` or ``velocity``.
    stated : float or None
        What the static identification (or the receiver) says, root mean square over the axes, SI; None where the
        filter has no such noise.
    unit : str
        Of `stated`.
    plain : Coefficient
        Factor on it with nothing named.
    named : Coefficient
        The same with all findings in the filter.
    causes : tuple of str
        Codes of what accounts for the factor, ``unknown`` for what nothing does; empty where the factor may be 1.
    identifiable : bool
        Whether the drive determines the factor at all.
    text : str
        All that in words.
    """

    setting: str
    stated: float | None
    unit: str
    plain: Coefficient
    named: Coefficient
    causes: tuple[str, ...]
    identifiable: bool
    text: str


@dataclass(frozen=True, repr=False)
class DriveDiagnosis(Shown):
    """What the navigation simulation gets wrong on a measured drive.

    Attributes
    ----------
    findings : tuple of Finding
        Named causes, the clearest first; axes are those of the sensor, lever arms of the vehicle where its mounting
        is known.
    before, after : FilterConfig
        The filter that was tested, and the same with all findings in it.
    unexplained : tuple of Unexplained
        Rejected tests without a cause.
    inseparable : tuple of Inseparable
        Causes that cannot be distinguished on this drive.
    notes : tuple of str
        What was done, and what is worth knowing.
    gain : Gain or None
        All findings together on the last 40 % of the drive, parameters from the first 60 %.
    noise_scales : tuple of NoiseScaleEstimate
        Factor on each noise setting, with its causes.
    """

    findings: tuple[Finding, ...]
    before: FilterConfig
    after: FilterConfig
    unexplained: tuple[Unexplained, ...] = ()
    inseparable: tuple[Inseparable, ...] = ()
    notes: tuple[str, ...] = ()
    gain: Gain | None = None
    noise_scales: tuple[NoiseScaleEstimate, ...] = ()

    @property
    def quiet(self) -> bool:
        """Whether nothing was found."""
        return not self.findings and not self.unexplained

    @property
    def credited(self) -> bool:
        """Whether what was found does no harm on the part held out; true where no gain could be measured.

        Harm is a loss of likelihood, or errors of outages whose change has an interval above zero.
        """
        if self.gain is None:
            return True
        worse = [low > 0.0 for name, (low, _) in self.gain.user.items() if "_change_interval" in name]
        return self.gain.nats >= 0.0 and not any(worse)

    @property
    def compensation(self) -> Compensation:
        """What is to be taken out of such drives, see `tuner.navigation.compensation`."""
        return self.after.compensation
