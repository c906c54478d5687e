"""Heights of fixes that err slowly, as by the delay of the ionosphere: a first-order process."""

from models.filter_states import Coupling, FilterState

HEIGHT_BIAS = FilterState(
    name="height_bias",
    components=("",),
    unit="m",
    meaning="height bias of fixes",
    couplings=(Coupling("", "position_down"),),
    time_constant=300.0,
)
