"""The tables of docs/unseen_kinds.md are those of runs/reference/unseen_kinds/ and unseen_signals/."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from epuckhebb.analysis import charts, rescue
from epuckhebb.analysis.image import image
from epuckhebb.analysis.statistics import bootstrap_mean, sign_flip
from epuckhebb.analysis.tables import markdown_table
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.tmaze.scenario import TRAINED

ROOT = Path(__file__).parents[1]
PAGE, REFERENCE = ROOT / "docs" / "unseen_kinds.md", ROOT / "runs" / "reference"
KINDS, SIGNALS = REFERENCE / "unseen_kinds", REFERENCE / "unseen_signals"
CHOSEN_ON = REFERENCE / "rescue_new_kinds" / "chosen_on"
LEARN, HALT, FIND = "find_and_learn_to_stay (anti)", "find_and_stay", "find"
RECOGNISE, RECOGNISE_HALT = "recognise_and_learn_to_stay", "recognise_and_halt"
CONTROLS = {
    FIND: "none: it finds, and nothing keeps it",
    "learn_hebbian": "the paper's sign",
    "learn_shuffled": "shuffled signs",
    "learn_fifth": "N at a fifth",
    LEARN: "**anti-Hebbian**",
    "learn_five_times": "N five times as high",
    HALT: "none: a halt, written by hand",
}
ORDER = (  # by class of knowledge
    *("stay", FIND, HALT, LEARN),
    *("self_check", "careful_self_check", "best", "careful_best", RECOGNISE_HALT, RECOGNISE),
    *("hand_written", "hand_written_recognises"),
)
FAULTS = {
    "": "exact",
    "signal_late": "1 s late",
    "signal_rare": "one step every second",
    "signal_false": "5 % false seconds",
    "signal_wide": "radius twice as large",
    "signal_by_chance": "from a random time on (control)",
}


HALTS = {HALT: "halt for good", "find_and_wait": "halt for 1.5 s", LEARN: "anti-Hebbian"}


@pytest.fixture(scope="module")
def over_all():
    return pd.read_csv(KINDS / "rescue_over_all.csv")


@pytest.fixture(scope="module")
def by_champion():
    return pd.read_csv(KINDS / "rescue_by_champion.csv")


@pytest.fixture
def figure(request):
    """Draw a figure of the page anew with --regenerate: what each row rescues and harms."""

    def draw(folder, name, over_all):
        if request.config.getoption("--regenerate"):
            (folder / "figures" / f"{name}.png").write_bytes(image(charts.rescue_over_all(over_all)))
        assert f"{folder.name}/figures/{name}.png" in PAGE.read_text()

    return draw


def rows_in(table, names):
    """The rows of these controllers, renamed, in this order in each experiment."""
    both = [table[table.experiment == one].set_index("controller").loc[list(names)].reset_index() for one in TRAINED]
    return pd.concat(both).assign(controller=lambda rows: rows.controller.map(names), N=0.0)


def row_of(table, experiment, controller):
    (row,) = table[(table.experiment == experiment) & (table.controller == controller)].itertuples()
    return row


def knowledge():
    """What each controller of the study is given or has by hand."""
    controllers = typed(composed("evaluate", ["experiment=unseen_kinds"]), EvaluateConfig).controllers
    return {one.name: one.knowledge for one in controllers}


def paired(by_champion, experiment, one, other, part="rescued", whole="broken"):
    """The mean difference of two shares over champions, with its interval and exact p value."""
    pair = [
        by_champion[(by_champion.experiment == experiment) & (by_champion.controller == name)].set_index("genome")
        for name in (one, other)
    ]
    assert (pair[0][whole] == pair[1][whole]).all()
    pair = [own[pair[0][whole] > 0] for own in pair]
    difference = pair[0][part] - pair[1][part]
    shares = (difference / pair[0][whole]).to_numpy()
    low, high = bootstrap_mean(shares, seed=0, bounds=(-1, 1))
    return shares.mean(), low, high, sign_flip(difference.to_numpy(np.int64))


def test_what_each_knows_and_rescues(generated, figure, over_all):
    known = knowledge()
    rows = []
    for experiment in TRAINED:
        for name in ORDER:
            row = row_of(over_all, experiment, name)
            given = ", ".join(known[name])
            counts = rescue.counts(row)
            rows.append([experiment, f"`{name.partition(' ')[0]}`", given, *counts, rescue.in_training(row)])
    head = ["experiment", "adaptation", "knowledge", rescue.RESCUED, rescue.HARMED, rescue.IN_TRAINING]
    generated(PAGE, "methods", markdown_table(head, rows))
    figure(KINDS, "knowledge", rows_in(over_all, {name: name.partition(" ")[0] for name in ORDER}))


def test_the_controls_of_the_plastic_rule(generated, figure, over_all, by_champion):
    rows = []
    for experiment in TRAINED:
        for name, text in CONTROLS.items():
            row = row_of(over_all, experiment, name)
            mean, low, high, p = paired(by_champion, experiment, name, FIND)
            more = "–" if name == FIND else f"{mean:+.2f} [{low:+.2f}, {high:+.2f}], p = {p:.2g}"
            rows.append([experiment, text, *rescue.counts(row), more])
    head = ["experiment", "what keeps it at the goal", rescue.RESCUED, rescue.HARMED, "rescued more than without"]
    generated(PAGE, "controls", markdown_table(head, rows))
    figure(KINDS, "controls", rows_in(over_all, {name: text.strip("*") for name, text in CONTROLS.items()}))


def test_the_careful_self_check(generated, over_all, by_champion):
    chosen_on, rows = pd.read_csv(CHOSEN_ON / "rescue_over_all.csv"), []
    for experiment in TRAINED:
        for usual, careful in (("self_check", "careful_self_check"), ("best", "careful_best")):
            mean, low, high, p = paired(by_champion, experiment, careful, usual, "harmed", "intact")
            for name in (usual, careful):
                before, row = (row_of(table, experiment, name) for table in (chosen_on, over_all))
                less = f"{mean:+.3f} [{low:+.3f}, {high:+.3f}], p = {p:.2g}" if name == careful else "–"
                known = [f"{before.rescued} of {before.broken}", f"{before.harmed} of {before.intact}"]
                rows.append([experiment, f"`{name}`", *known, *rescue.counts(row), less])
    head = ["experiment", "adaptation", "earlier kinds: rescued", "harmed", rescue.RESCUED, rescue.HARMED]
    generated(PAGE, "careful", markdown_table([*head, "harm, less that of the usual one"], rows))


def test_kind_by_kind(generated, figure):
    table = pd.read_csv(KINDS / "rescue_and_harm.csv")
    shown = {"stay": "halt only", HALT: "find and halt", LEARN: "find and learn", RECOGNISE_HALT: "recognise and halt"}
    shown |= {RECOGNISE: "recognise and learn"}
    rows = []
    for experiment, training in TRAINED.items():
        own = table[table.experiment == experiment]
        for scenario in own.scenario.drop_duplicates():
            cells = own[own.scenario == scenario].set_index("controller").loc[list(shown)]
            kind = scenario.removeprefix(training).strip("_") or "the training world"
            counts = (f"{row.rescued}/{row.broken}, {row.harmed}/{row.intact}" for row in cells.itertuples())
            rows.append([experiment, kind, *counts])
    generated(PAGE, "kinds", markdown_table(["experiment", "kind of change", *shown.values()], rows))
    own = table[table.controller == RECOGNISE]
    kinds = [row.scenario.removeprefix(TRAINED[row.experiment]).strip("_") for row in own.itertuples()]
    figure(KINDS, "kinds", own.assign(controller=kinds, N=0.0)[[kind != "" for kind in kinds]])


def test_goal_signals_that_lie(generated, figure):
    table = pd.read_csv(SIGNALS / "rescue_and_harm.csv")
    rows, drawn = [], []
    for experiment, training in TRAINED.items():
        own = table[table.experiment == experiment]
        for fault, text in FAULTS.items():
            if not fault:
                continue
            alone = own[own.scenario == f"{training}_{fault}"].set_index("controller")
            kinds = own[own.scenario.str.endswith(f"_{fault}") & (own.scenario != f"{training}_{fault}")]
            summed = kinds.groupby("controller")[["rescued", "broken", "harmed", "intact"]].sum()
            cells = []
            for name, does in HALTS.items():
                one, home = summed.loc[name], alone.loc[name]
                share = one.rescued / one.broken
                cells.append(f"{one.rescued} of {one.broken}: {share:.2f}")
                harmed, intact = one.harmed + home.harmed, one.intact + home.intact
                cells.append(f"{harmed} of {intact}")
                shares = {"rescued_share": share, "harmed_share": harmed / intact}
                drawn.append({"experiment": experiment, "controller": f"{text}: {does}", "N": 0.0, **shares})
            rows.append([experiment, text, *cells])
    head = ["experiment", "goal signal", *(cell for does in HALTS.values() for cell in (f"{does}: rescued", "harmed"))]
    generated(PAGE, "signals", markdown_table(head, rows))
    bounds = [f"{part}_{end}" for part in ("rescued", "harmed") for end in ("low", "high")]
    figure(SIGNALS, "signals", pd.DataFrame(drawn).reindex(columns=[*drawn[0], *bounds]))
