"""A reference that is wrong is said in one line behind the verdict of each answer, which keeps to ten lines."""

from dataclasses import replace

import pytest

from tuner.consistency.verdicts import verdicts
from tuner.formats.reference_words import reference_line, wrong_attitude_text, wrong_times_text
from tuner.limits import SCREEN_LINES
from tuner.report.consistency_answer import consistency_answer
from tuner.report.document import document
from tuner.report.drive_diagnosis_tables import drive_diagnosis_answer
from tuner.report.terminal import fitted, text_of
from tuner.types import DriveDiagnosis
from tuner.types.consistency import Consistency, Outage, RmsError, Score, Whiteness
from tuner.types.named_cause import NamedCause

SPANS = [(61.0, 121.0), (167.0, 228.0)]
TIMES = wrong_times_text(20, 12.8, SPANS, any_left=True)
TURNS = wrong_attitude_text(["its heading by 2.0° in 15 s, of which the gyroscopes show -3 ± 5 %"])
BOTH = "Reference wrong in 20 s: 121 s not judged by it, attitude not compared"


def off(name, ratio):
    return Score(name, 10.0 * ratio**2, 10, 10.0, (9.0, 11.0))


OUTAGES = [(10.0, 8.52, 1.04), (30.0, 13.4, 9.59), (60.0, 93.2, 55.9)]
FOUND = Consistency(
    None,
    (off("position", 19.3), off("velocity", 1.26)),
    (off("nis", 0.585), off("nis_position", 0.505), off("nis_velocity", 0.667)),
    Whiteness("position", 10, 0.969, 0.133),
    tuple(Outage(s, true, own, off(f"outage {s:g} s", true / own), 4) for s, true, own in OUTAGES),
    {
        "position": RmsError((2.39, 2.53, 9.98), "m"),
        "velocity": RmsError((0.229, 0.243, 0.075), "m/s"),
    },
    0.0,
    diverged=False,
)
FOUND = replace(FOUND, verdicts=verdicts(FOUND))


@pytest.mark.parametrize(
    ("notes", "line"),
    [
        (["one fix of 7 is looked at"], []),
        ([TIMES], ["Reference wrong in 20 s: 121 s not judged by it"]),
        ([TIMES, TURNS], [BOTH]),
        ([TURNS], ["Reference wrong: it turns while the vehicle stands, attitude not compared"]),
        ([wrong_times_text(20, 12.8, SPANS, any_left=False)], ["Reference wrong in 20 s: nothing judged by it"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(notes, line):
    assert reference_line(notes) == line
    assert all(len(one) <= 80 for one in line)


def test_the_answer_of_navigate_says_it_beneath_its_verdict():
    """Two paths, all scores off: as much as an answer of a drive has to say."""
    to_do = [
        "What to do: `tuner diagnose " + "a" * 52 + " --config mpu9250` looks for causes",
        "Solution: out",
    ]
    lines = fitted(consistency_answer(FOUND, [TIMES, TURNS], to_do))
    assert BOTH in lines
    assert lines[0].startswith("Verdict: optimistic")
    assert len(lines) <= SCREEN_LINES
    assert max(map(len, lines)) <= 80


def test_without_a_truth_states_are_said_to_be_compared_with_the_smoother():
    """For a day "position, 3-D" of a drive without a reference read as the error of the position."""
    rows = {line.partition("  ")[0] for line in fitted(consistency_answer(FOUND))}
    assert {"position, 3-D", "velocity, 3-D"} <= rows
    alone = fitted(
        consistency_answer(replace(FOUND, errors={"nis_position": RmsError((1.0, 1.0, 2.0), "m")}))
    )
    rows = {line.partition("  ")[0] for line in alone}
    assert {"position, 3-D, to the smoother", "velocity, 3-D, to the smoother"} <= rows
    assert "position innovations (root of NIS)" in rows


def test_the_answer_of_diagnose_says_it_beneath_its_verdict():
    lines = fitted(drive_diagnosis_answer(DriveDiagnosis((), None, None, notes=("another", TIMES, TURNS))))
    assert lines[1] == BOTH


LATE = NamedCause.of(
    "fixes are stamped 1.980 ± 0.062 s late", "certain", "12 m at 6.1 m/s", "taken out of this run"
)


def test_a_named_cause_stands_beside_the_verdict_and_no_more_among_the_notes():
    """Late fixes and an unknown frame stood in the last lines, as notes."""
    for lines in (
        fitted(consistency_answer(FOUND, ["one fix of 7 is looked at", LATE])),
        fitted(
            drive_diagnosis_answer(DriveDiagnosis((), None, None, notes=("one fix of 7 is looked at", LATE)))
        ),
    ):
        said = "\n".join(lines)
        at = next(
            i for i, line in enumerate(lines) if line.startswith("Fixes are stamped 1.980 ± 0.062 s late")
        )
        verdict = next(i for i, line in enumerate(lines) if line.startswith("Verdict"))
        assert all(line.startswith("  ") for line in lines[verdict + 1 : at])
        assert said.count("stamped") == 1
        assert "Note: one fix of 7" in said


def test_a_command_that_goes_on_in_a_second_line_is_not_parted_again():
    """A line that is as wide as the terminal was folded once more: a lone backslash breaks the command when pasted."""
    words = "export campus/noise.yaml --to kf-gins --drive campus/mended.npz -o campus/kf-gins/kf-gins.yaml"
    shown = text_of(document(["Verdict: usable"]).then(*words.split()))
    *_, first, second = shown.rstrip().splitlines()
    assert first.endswith(" -o \\")
    assert second.strip() == "campus/kf-gins/kf-gins.yaml"
