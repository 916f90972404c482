"""Every file of conf/ composes into a checked configuration."""

import dataclasses
import itertools
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from cases import done
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.config.compose import composed, configurations
from epuckhebb.config.overrides import alternatives, hydra_arguments, readable
from epuckhebb.config.parts import part_class
from epuckhebb.config.schema import EvaluateConfig, EvolveConfig, typed
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.training import Training
from epuckhebb.runtime import ConfigError
from epuckhebb.runtime.conf import groups
from epuckhebb.runtime.resources import data_folder
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.scenario import Scenario

SCHEMA = {"evaluate": EvaluateConfig, "evolve": EvolveConfig}


@pytest.mark.parametrize("command", SCHEMA)
def test_every_choice_of_every_group_composes(command):
    """Those of groups that go together side by side; `change` in test_change_group.py."""
    elsewhere = {"change", *(groups("evaluate") if command == "evolve" else ())}
    choices = {group: names for group, names in groups(command).items() if group not in elsewhere}
    together = [["adaptation", "hebbian", "scenario"], ["maze", "experiment"], ["optimizer", "training"]]
    for some in [*together, *([group] for group in choices if group not in itertools.chain(*together))]:
        for names in itertools.zip_longest(*(choices.get(group, ()) for group in some)):
            words = [f"{group}='{name}'" for group, name in zip(some, names, strict=True) if name is not None]
            if hydra_arguments(command, words)[0] == command:  # else a sweep of environments, without a maze
                typed(composed(command, words), SCHEMA[command])  # quoted: some names are numbers


def test_defaults_are_the_papers():
    evaluate = typed(composed("evaluate", []), EvaluateConfig)
    assert (evaluate.controllers[0].rule.N, evaluate.lifetime.duration_s, evaluate.lifetime.gain_rad_s) == (
        0.000015,
        250,
        1,
    )
    light = typed(composed("evaluate", ["scenario=lowlight"]), EvaluateConfig)
    assert (light.controllers[0].rule.N, light.lifetime.duration_s, light.scenario.lamp.y_m) == (0.002, 200, -0.3)
    evolve = typed(composed("evolve", []), EvolveConfig)
    assert (evolve.ga.population, evolve.ga.generations, evolve.ga.elites, evolve.ga.loops) == (50, 30, 6, 3)
    assert (evolve.lifetime.duration_s, evolve.lifetime.gain_rad_s) == (60, 4)


def test_every_file_says_what_it_is_for():
    for file in data_folder("conf").rglob("*.yaml"):
        assert file.read_text().startswith("# "), file
        yaml.safe_load(file.read_text())


@pytest.mark.usefixtures("here")
def test_one_evaluation_opens_a_file_of_settings_at_most_twice():
    opened = (
        "import sys, collections; seen = collections.Counter();"
        "sys.addaudithook(lambda event, args: event == 'open' and seen.update([str(args[0])]));"
        "from epuckhebb.cli.commands import app;"
        "app(['evaluate', 'scenario=4obstacles', 'hebbian.N=0.001', 'repeats=1', 'lifetime.duration_s=1', '-q'],"
        " standalone_mode=False);"
        "print(max(count for file, count in seen.items() if file.endswith(('scenarios.yaml', 't_maze.yaml'))))"
    )
    done = subprocess.run([sys.executable, "-c", opened], capture_output=True, text=True, check=True)
    assert int(done.stdout.split()[-1]) <= 2


def test_the_champions_in_a_folder_are_named(here):
    for name in ("mine/9/champion.npz", "mine/10/champion.npz", "mine/notes/text", "mine/1.npz"):
        file = here / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    assert readable(["genome=mine/*"]) == ["genome=mine/1.npz,mine/9,mine/10"]
    assert readable([f"start={here}/mine/[1]*,latest"]) == [f"start={here}/mine/1.npz,{here}/mine/10,latest"]
    with pytest.raises(ConfigError, match="genome=yours"):
        readable(["genome=yours/*"])


def test_the_champions_between_two_are_named():
    given = ["genome=reference_1,...,reference_4,mine/9,...,mine/11", "seed=1,...,3"]
    named = ["genome=reference_1,reference_2,reference_3,reference_4,mine/9,mine/10,mine/11", "seed=1,2,3"]
    assert readable(given) == named


# What is compared, and what is called how


@pytest.mark.parametrize(("scenario", "rate"), [("base", 0.000015), ("lowlight", 0.002)])
def test_what_is_compared_runs_at_the_papers_rate_of_its_scenario(scenario, rate):
    words = [f"scenario={scenario}", "compare.x={sign: shuffled}", "compare.y={adaptation: late}"]
    paper, x, y = typed(composed("evaluate", words), EvaluateConfig).controllers
    assert (paper.name, x.name, y.name) == ("Hebbian", "x", "y")
    assert paper.rule.N == x.rule.N == y.rule.N == rate
    assert (x.rule.sign.name, y.rule.sign.name) == ("shuffled", "hebbian")
    assert (y.adaptation.change_signal, y.adaptation.active_s, y.adaptation.motor_noise) == ("late", 10, 2)
    assert not x.adaptation.acts


@pytest.mark.parametrize(
    ("words", "name", "rule", "rate"),
    [
        ([], "Hebbian", "Paper", 0.000015),
        (["hebbian.sign=anti"], "anti-Hebbian", "Paper", 0.000015),
        (["hebbian=mild"], "mild", "Paper", 0.0002),
        (["hebbian=bcm"], "bcm", "BCM", 0.000015),
        (["hebbian=bcm", "hebbian.sign=shuffled"], "bcm (shuffled)", "BCM", 0.000015),
        (["adaptation=late"], "late", "Paper", 0.0005),
        (["adaptation=novelty"], "novelty", "Paper", 0.0002),
        (["adaptation=late", "hebbian=oja"], "late", "Oja", 0.000015),
        (["adaptation=late", "hebbian=none"], "late", "NoRule", 0),
        (["adaptation=late", "hebbian.N=0.1"], "late", "Paper", 0.1),
        (["hebbian.name=mine"], "mine", "Paper", 0.000015),
        (["adaptation.change_signal=novelty", "adaptation.name=mine"], "mine", "Paper", 0.000015),
    ],
)
def test_a_controller_is_called_as_in_tables(words, name, rule, rate):
    (controller,) = typed(composed("evaluate", words), EvaluateConfig).controllers
    assert (controller.name, type(controller.rule).__name__.lower(), controller.rule.N) == (name, rule.lower(), rate)


# The files of conf/


@pytest.mark.thorough
@pytest.mark.parametrize("robot", groups("evaluate")["robot"])
@pytest.mark.parametrize("maze", groups("evaluate")["maze"])
@pytest.mark.parametrize(("command", "schema"), [("evaluate", EvaluateConfig), ("evolve", EvolveConfig)])
def test_every_maze_with_every_robot(command, schema, maze, robot):
    config = typed(composed(command, [f"maze={maze}", f"robot={robot}"]), schema)
    assert (config.world.maze.name, config.world.robot.name) == (maze, robot)


RULES, ADAPTATIONS = groups("evaluate")["hebbian"], groups("evaluate")["adaptation"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("hebbian", "adaptation"),
    sorted({*itertools.product(RULES, ["none", "late"]), *itertools.product(["none", "paper"], ADAPTATIONS)}),
)
def test_adaptations_over_rules(hebbian, adaptation):
    if hebbian == "none" and adaptation.endswith("_learn_to_stay"):
        with pytest.raises(ConfigError, match="plastic_when=goal_signal needs a plasticity rule"):
            typed(composed("evaluate", ["hebbian=none", f"adaptation={adaptation}"]), EvaluateConfig)
        return
    config = typed(composed("evaluate", [f"hebbian={hebbian}", f"adaptation={adaptation}"]), EvaluateConfig)
    assert len(config.controllers) == ((hebbian, adaptation) != ("none", "none"))
    for controller in config.controllers:
        assert controller.adaptation.acts == (adaptation != "none")
        assert (controller.rule.N > 0) == (hebbian != "none")


def controllers(*words):
    return typed(composed("evaluate", list(words)), EvaluateConfig).controllers


@pytest.mark.parametrize(
    ("words", "rule", "rate"),
    [
        (["hebbian=oja", "hebbian.N=0.0003"], "Oja", 0.0003),
        (["hebbian=mild"], "Paper", 0.0002),
        (["hebbian=none"], "Paper", 0.002),
        (["adaptation=wall_following"], "Paper", 0.002),
    ],
    ids=["own rule", "own rate", "no rule", "an adaptation without a rule"],
)
def test_what_is_compared_differs_from_the_rule_of_the_run(words, rule, rate):
    *_, control = controllers("scenario=lowlight", *words, "compare.control={sign: shuffled}")
    assert (type(control.rule).__name__, control.rule.N, control.rule.sign.name) == (rule, rate, "shuffled")


def test_what_is_compared_by_its_name_is_what_the_name_alone_gives():
    main, *others = controllers("scenario=lowlight", "compare=[late,find_and_stay,homeostasis,oja,mild]")
    assert main.name == "Hebbian"
    for other in others:
        group = "hebbian" if other.name in ("oja", "mild") else "adaptation"
        (alone,) = controllers("scenario=lowlight", f"{group}={other.name}")
        assert other == alone


@pytest.mark.parametrize("name", ["none", "paper"])
def test_none_beside_an_adaptation_is_the_papers_rule(name):
    late, beside = controllers("adaptation=late", f"compare=[{name}]")
    assert (late.name, beside) == ("late", controllers()[0])


def test_what_lives_anyway_is_not_compared_twice():
    assert [one.name for one in controllers("compare=[late,none]")] == ["Hebbian", "late"]
    assert [one.name for one in controllers("adaptation=late", "compare=[late,none]")] == ["late", "Hebbian"]


# What differs from the named scenario


@pytest.mark.parametrize(
    ("words", "changed"),
    [
        ([], ""),
        (["scenario.light=0.1"], ""),
        (["scenario.goals={left: null}"], ""),
        (["scenario.goals={left: [-0.3, 0.155]}"], "goals.left=[-0.3,0.155]"),
        (["scenario=4obstacles", "scenario.obstacles=4"], ""),
        (["scenario.left_wheel=0.8"], "left_wheel=0.8"),
        (["scenario.light=1.0", "scenario.lamp.beam_rad=1.2"], "light=1, lamp.beam_rad=1.2"),
        (["scenario.changes=[{at_s: 1, light: 1.0}]"], "light=1 at 1 s"),
        (["maze=t_maze_wide"], "maze=t_maze_wide"),
        (["maze=double_t", "robot=epuck_lidar"], "maze=double_t, robot=epuck_lidar"),
        (["scenario=lowlight", "hebbian=oja", "seed=3"], ""),
        (["scenario=lowlight", "lifetime.duration_s=200", "lifetime.record_every=0"], ""),
        (["scenario=lowlight", "lifetime.duration_s=250"], "lifetime.duration_s=250"),
        (["scenario.paper_duration_s=50"], "paper_duration_s=50"),
        (["lifetime=evolve"], "lifetime.duration_s=60, lifetime.gain_rad_s=4"),
        (["task=reversal"], "task=reversal"),
        (["maze.obstacles.arm_left.x=-0.1", "scenario.layout=3"], ""),  # of obstacles that do not stand
        (["scenario.obstacles=2", "maze.obstacles.arm_left.x=-0.1"], "obstacles=2, maze.obstacles.arm_left.x=-0.1"),
        (["physics=ode", "maze.wall_height_m=0.1"], "physics=ode, maze.wall_height_m=0.1"),
    ],
)
def test_what_differs_from_the_named_scenario_is_told(words, changed):
    cfg = composed("evaluate", words)
    assert cfg.changed == changed
    assert cfg.scenario.name == (words[0].partition("=")[2] if words and words[0].startswith("scenario=") else "base")


@pytest.mark.parametrize(
    "word", ["robot.solid.mass_kg=0.3", "robot.solid.wheel_width_m=0.006", "maze.wall_height_m=0.1"]
)
def test_what_the_physics_ignores_is_refused(word):
    with pytest.raises(ConfigError, match="physics"):
        composed("evaluate", [word])
    assert composed("evaluate", ["physics=ode", word]).changed.endswith(word)


def test_what_differs_in_training_and_in_the_jobs_of_a_sweep_is_told():
    assert composed("evolve", []).changed == ""
    assert composed("evolve", ["scenario.light=0.5", "lifetime.noise=0"]).changed == "light=0.5, lifetime.noise=0"
    choices = alternatives(["lifetime.duration_s=100,250", "seed=1,2"])
    told = [
        config["changed"] for _, config in configurations("evaluate", [], itertools.product(*choices.values()), None)
    ]
    assert told == ["lifetime.duration_s=100"] * 2 + [""] * 2


def test_a_caller_who_composes_with_hydra_can_go_on(tmp_path):
    (tmp_path / "own.yaml").write_text("value: 1\n")
    with initialize_config_dir(str(tmp_path), version_base="1.3"):
        composed("evaluate", [])
        with pytest.raises(ConfigError):
            composed("evaluate", ["scenario=none"])
        before = sys.argv, os.environ.get("HYDRA_FULL_ERROR")
        done("evaluate", "--cfg=job")
        assert (sys.argv, os.environ.get("HYDRA_FULL_ERROR")) == before
        assert compose("own").value == 1


RULE = Path(__file__).parents[1] / "examples" / "own_rule" / "my_rules.py"


@pytest.mark.parametrize("rule", ["abcd", "oja", "none", "paper", f"{RULE}:Gated"])
def test_a_rule_is_one_choice_by_either_key(rule):
    for command, more in (("evaluate", []), ("evaluate", ["adaptation=late"]), ("evolve", ["hebbian.w_max=1"])):
        words = [] if rule == "none" and command == "evolve" else more
        first, second = (composed(command, [f"{key}={rule}", *words]) for key in ("hebbian", "hebbian.rule"))
        assert first == second
    assert composed("evaluate", ["compare.x.rule=abcd"]).compare.x.N == composed("evaluate", ["hebbian=abcd"]).hebbian.N


def test_two_choices_of_a_rule_are_refused():
    with pytest.raises(ConfigError, match=r"hebbian=oja and hebbian\.rule=abcd"):
        hydra_arguments("evaluate", ["hebbian=oja", "hebbian.rule=abcd"])


def test_a_row_and_an_own_rule_are_one_list_by_either_key():
    for key in ("hebbian", "hebbian.rule"):
        assert hydra_arguments("evaluate", [f"{key}=none,{RULE}:Gated"]) == ("evaluate", [f"hebbian=none,{RULE}:Gated"])


def test_a_sweep_over_rules_by_either_key_has_the_same_jobs():
    jobs = [
        [config for _, config in configurations("evaluate", [], [(f"{key}=oja",), (f"{key}=bcm",)], None)]
        for key in ("hebbian", "hebbian.rule")
    ]
    assert jobs[0] == jobs[1]
    assert hydra_arguments("evaluate", ["hebbian.rule=oja,bcm"])[1] == ["hebbian=oja,bcm"]
    assert hydra_arguments("evaluate", ["hebbian=a.py:A,b.py:B"])[1] == ["hebbian.rule=a.py:A,b.py:B"]


BESIDES = {
    "scenario.hand",
    "lifetime.record_every",
    "training.name",
    "changed",
}  # another form, or of the command alone


def other_defaults(kind, values, key):
    """The keys of a dataclass of which Python and YAML have another default."""
    missing = dataclasses.MISSING
    defaults = {
        one.name: one.default_factory() if one.default is missing else one.default
        for one in dataclasses.fields(kind)
        if not one.default is one.default_factory is missing
    }
    plain = {
        name: list(value) if isinstance(value, tuple) else getattr(value, "name", value)
        for name, value in defaults.items()
        if not dataclasses.is_dataclass(value)
    }
    return {f"{key}.{name}" for name, value in plain.items() if values.get(name, value) != value} - BESIDES


@pytest.mark.parametrize(
    ("kind", "command", "key"),
    [
        (Scenario, "evaluate", "scenario"),
        (Lamp, "evaluate", "scenario.lamp"),
        (Lifetime, "evaluate", "lifetime"),
        (Adaptation, "evaluate", "adaptation"),
        (GA, "evolve", "ga"),
        (Training, "evolve", "training"),
    ],
)
def test_python_and_yaml_have_one_default(kind, command, key):
    values = OmegaConf.to_container(OmegaConf.select(composed(command, []), key), resolve=True, enum_to_str=True)
    assert len(values) > 3
    assert other_defaults(kind, values, key) == set()


@pytest.mark.parametrize("name", ["sep_cma_es", "open_es"])
def test_optimizers_have_one_default(name):
    values = composed("evolve", [f"optimizer={name}"]).optimizer
    assert other_defaults(part_class("optimizer", name, "optimizer"), values, "optimizer") == set()
