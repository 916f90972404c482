"""What cannot be: exit code 2, one message that names the key or the file, nothing written."""

import re
import shlex
import warnings
import zipfile

import numpy as np
import pytest
from cases import call, contents, first_of, refused

from epuckhebb.config import load_any
from epuckhebb.config.errors import explain
from epuckhebb.runtime import ConfigError
from epuckhebb.store.genome import champion_file, load_genome

RULE = """from dataclasses import dataclass
from epuckhebb import Rule

@dataclass(frozen=True, kw_only=True)
class oja(Rule):
    decay: float = 1.0

    @staticmethod
    def synapse({asked}):
        return {given}
"""
FILES = {
    "my_rules.py": RULE.format(asked="correlation, post, weight, by", given="correlation - by.decay * post * weight"),
    "syntax.py": "x = 1\ndef f(:\n",
    "raising.py": "x = 1\nraise RuntimeError('boom')\n",
    "unknown.py": RULE.format(asked="prae, post", given="prae"),
    "text.txt": "x = 1\n",
    "text.npz": "not a genome",
    "genes.csv": "0.1,0.2",
    "conf/scenario/misspelt.yaml": "ligth: 0.03\n",
    "conf/scenario/in_words.yaml": "light: dim\n",
    "conf/scenario/from_none.yaml": "defaults: [2obstacle, _self_]\nlight: 0.1\n",
    "conf/scenario/too_deep.yaml": "scenario:\n  light: 0.1\n",
    "conf/scenario/number.yaml": "42\n",
    "conf/scenario/dotted.yaml": "lamp.x_m: 0.2\n",
    "conf/experiment/no_package.yaml": "hydra:\n  sweeper:\n    params:\n      hebbian.N: 1e-5,1e-4\n",
    "conf/experiment/text.yaml": "# @package _global_\nscenario: lowlight\n",
    "conf/experiment/pattern.yaml": "# @package _global_\nhydra: {sweeper: {params: {scenario: glob(*)}}}\n",
    "conf/experiment/alone.yaml": "# @package _global_\nseed: 3\n",
    "empty/notes.txt": "dear",
}
OJA = "hebbian.rule=my_rules.py:oja hebbian.N=0.0001"
REFUSED = f"""
# a reference to a key that is none
evaluate scenario.name=${{x.y}}                           | scenario.name | x.y
evaluate -m seed=1,2 scenario.light=${{x}}                | scenario.light | x
sweep obstacles ++hebbian.carries_history=${{x}} scenario=base | hebbian.carries_history | x
# keys and choices that are none: the near one
evaluate scenrio=base                                   | scenrio | scenario
evaluate scenario=5obstacles                            | 5obstacles | 4obstacles
evaluate scenario=murky                                 | scenario=murky | lowlight
evaluate hebian.N=0.002                                 | hebian.N | hebbian.N
evaluate hebbian=ojas                                   | hebbian=ojas | oja
evaluate +hebian.N=0.9                                  | hebbian
evaluate +hebbian.trace_decya=1                         | trace_decay
evaluate N=0.1                                          | key N
evaluate rule=oja                                       | key rule
evaluate +experiment=n_sweep                            | +experiment=n_sweep | override
evolve ga.pop=3                                         | ga.pop | ga.population
evaluate robot.moter_limit_rad_s=3                      | robot.moter_limit_rad_s | motor_limit_rad_s
evaluate ~maze.lamp                                     | maze.lamp.x_m, which is missing
evaluate network=ctrnn                                  | network | ctrnn
evaluate compare=late                                   | compare | late
evaluate adaptation=[late,novelty]                      | adaptation | novelty
evaluate change.a={{physics:od}}                          | change.a | od
evaluate genome=best                                    | genome=best | latest
evaluate compare=[1]                                    | compare
evaluate compare.a={{adaptation:latte}}                 | compare.a | latte | late_steady
evaluate +compare.a={{M:1}}                             | compare.a | M
evaluate hebbian=oja hebbian.trace_decay=1              | hebbian.trace_decay | oja
evolve training.lihgt=1                                 | training.lihgt | training.light
evolve optimizer=other                                  | sep_cma_es
evolve task=reversal task.trails=3                      | task.trails
evolve optimizer=sep_cma_es optimizer.elites=2          | optimizer.elites
reproduce sound                                         | sound | light, obstacles, all
sweep nope                                              | nope | n_sweep
sweep light scenario=nope                               | scenario=nope | 4obstacles
keys hebian                                             | hebbian
# keys of another verb, and what does nothing
evaluate training.light=1                               | training.light
evolve adaptation=late                                  | adaptation
evolve repeats=5                                        | repeats
evaluate changed=mine                                   | changed
evaluate hebbian=none hebbian.N=0.01                    | hebbian.N
evaluate adaptation.threshold=2                         | adaptation.threshold
evaluate adaptation.motor_noise=2                       | adaptation.motor_noise
evaluate adaptation=late_steady adaptation.rest_s=1     | adaptation.active_s above 0
evaluate compare.a={{adaptation:{{threshold:1}}}}       | compare.a | threshold
evolve optimizer=sep_cma_es ga.population=20            | ga.population
evolve optimizer=sep_cma_es ga=as_coded                 | optimizer.population
evolve optimizer.algorithm=sep_cma_es                   | optimizer=ga
evolve optimizer=sep_cma_es ga.generations=2           | optimizer=ga
evolve optimizer.population=20                          | optimizer.population
evolve hebbian=paper genome=reference                   | nothing would be evolved
evolve hebbian=carried                                  | hebbian.carries_history
evolve genome=reference                                 | nothing would be evolved
evolve hebbian=modulated hebbian.reward=inverted        | hebbian.reward
evolve hebbian=abcd hebbian.reward=inverted             | hebbian.reward | abcd
evolve task.trials=3                                    | task.trials | task trial
# values
evaluate hebbian.N=fast                                 | hebbian.N | fast
evaluate hebbian.N=-1                                   | hebbian.N | -1
evaluate scenario.light=1e308                           | scenario.light | 1e+06
evaluate scenario.lamp.intensity=1e308                  | scenario.lamp.intensity
evaluate scenario.second_lamp=[0,0,1e308]               | scenario.second_lamp
evaluate robot.motor_limit_rad_s=0.5                    | lifetime.gain_rad_s | robot.motor_limit_rad_s
evaluate hebbian.N=0,002                                | hebbian.N=0,002
evaluate scenario.obstacles=2.5                         | scenario.obstacles | 2.5
evaluate repeats=0                                      | repeats
evaluate seed=null                                      | seed
evaluate hebbian.signal=joy                             | joy | light_code
evaluate hebbian=null                                   | hebbian
evaluate lifetime=null                                  | lifetime
evaluate ~hebbian=inf                                   | ~hebbian=inf
evaluate -q --cfg=job ~scenario=1.5                     | ~scenario=1.5
evaluate hebbian.N                                      | hebbian.N | KEY=VALUE
evaluate hebbian.N=0,0.002 scenario=base,4obstacles     | --multirun
evaluate -m hebbian.N=0,-1                              | hebbian.N | -1
evaluate compare.a=5                                    | compare.a | 5
evaluate +compare.a={{N:-1}}                            | compare.a | N must be 0 or more
evaluate +compare.GA={{N:1}}                            | GA
evaluate hebbian.name=GA                                | GA
evaluate adaptation=late compare.late={{N:1}}           | late
evaluate scenario.dead_sensors=[8]                      | scenario.dead_sensors | 0 to 7
evaluate scenario.goals={{left:[-30,60]}}               | scenario.goals.left | -30
evaluate scenario.goals={{left:[0.3]}}                  | scenario.goals | [0.3]
evaluate maze.start={{x:0.09,y:-0.2,heading_deg:90}}    | maze.start | room
evaluate scenario.changes=[{{at_s:500,light:1}}]        | changes[0].at_s | less than
evaluate scenario.changes=[1]                           | scenario.changes[0] | [1]
evaluate network.layers=[15,4,2]                        | 16 | epuck | [15, 4, 2]
evaluate network.layers=[16,4,3]                        | network.layers
sweep light scenario.light=1,-1                         | scenario.light | -1
reproduce champions=0                                   | champions
reproduce rates=[-1]                                    | rates | -1
evolve training.layouts=[1,59]                          | training.layouts | [1, 59]
evolve training.wheel=[0.8,1.1]                         | training.wheel
evolve training.gain_rad_s=[1.5,7]                      | training.gain_rad_s | 6.28
evolve training.gain_rad_s=[1.5,6] scenario.changes=[{{at_s:50,light:1.0}}] | 40 s
evolve training=varied ga.loops=1                       | training.unvaried_loops
evolve training=varied optimizer=sep_cma_es optimizer.loops=1 | training.unvaried_loops
evolve training=varied maze=double_t                    | training.obstacles_share | double_t
evolve hebbian=abcd_shared hebbian.leak=-1              | hebbian.leak | -1
evaluate hebbian=online hebbian.N=-1                    | hebbian.N | -1
evolve hebbian=online hebbian.window_s=0                | hebbian.window_s | 0
evolve hebbian=abcd hebbian.initial_weights=early                | hebbian.initial_weights | random
evolve optimizer=sep_cma_es optimizer.population=1      | optimizer.population
evolve optimizer=sep_cma_es optimizer.generations=many  | optimizer.generations
evolve optimizer=open_es optimizer.population=5         | optimizer.population
evolve optimizer=open_es optimizer.learning_rate_decay=2 | optimizer.learning_rate_decay
evolve optimizer=evolve_and_merge hebbian=none          | optimizer.merges
evolve task=reversal scenario.lamp.intensity=2          | scenario.lamp.intensity
evolve task=reversal lifetime.duration_s=60             | lifetime.duration_s | 309.76
evolve task=reversal training=gain_varied               | training.gain_rad_s
evolve task=reversal network.layers=[16,3,2]            | 17
evolve task=reversal task.first_switch=1                | task.first_switch
evolve task=reversal task.switches=5                    | task.switches | 4 | task.last_switch=8 | task.trials=10
evolve task=reversal task.trials=5 task.last_switch=6   | task.last_switch | 5
evolve task=reversal task.trials=-1                     | task.trials | 1000
evolve task=reversal task.first=right                   | task.first | drawn | left
evolve hebbian=modulated hebbian.acts=before_change     | hebbian.acts | trial
evolve task=reversal hebbian=modulated hebbian.acts=now | hebbian.acts | before_change
evaluate task=reversal                                  | task=trial
# what no machine could do
evolve ga.tournament=100000000000                       | ga.tournament | 100000000000
evaluate threads=1000000                                | threads | 1024
evaluate -m seed=range(1,1000000000)                    | 100000 jobs
sweep n_sweep seed=range(1,1000) repeats=range(1,1000)  | 100000 jobs
# genomes, runs and folders
evaluate genome=nowhere.npz                             | nowhere.npz | reference
evaluate genome=short.npy                               | 234 | 227
evaluate genome=nan.npy                                 | finite
evaluate genome=long.npy                                | finite | 234
evaluate genome=far.npy                                 | far.npy | +-2 | 244
evaluate genome=zeros.npz                               | zeros.npz | two arrays | genome
evaluate genome=lights.npz                              | 3 lights | 8 lights
evaluate genome=pole.npz                                | pole | environment=cartpole
evolve genome=pole.npz hebbian=abcd                     | environment=cartpole
evaluate genome=strong.npz hebbian=abcd                | strong: A | +-2 | 10
evaluate genome=text.npz                                | text.npz
evaluate genome=genes.csv                               | genes.csv | numpy.save
show genes.csv                                          | genes.csv
evaluate 'genome=grün(1).npy'                           | there is no file grün(1).npy
evaluate genome=a,b&c.npy                               | several values
sweep light 'genome=a=b.npy'                            | there is no file a=b.npy
evaluate genome=layers.npz                              | layers.npz | 152
evaluate genome=empty                                   | genome=empty | champion.npz
evaluate genome=reference_77                            | reference_77
evaluate genome=reference network.layers=[16,4,2]       | 16-7-5-8-4-2 | [16, 4, 2]
evaluate robot=epuck_lidar                              | epuck_lidar
evaluate genome=lidar.npz robot=epuck                   | epuck_lidar
evaluate -m genome=lidar.npz,reference                  | robot=epuck_lidar
evaluate adaptation=late genome=light.npz               | highlight | experiment
evaluate adaptation=late genome=broken.npz              | broken.npz
evaluate genome=latest                                  | epuckhebb evolve
evaluate genome='~nosuchuser/x'                         | ~nosuchuser
evaluate hebbian.rule='~nosuchuser/x.py:Rule'           | ~nosuchuser
evolve resume=~nosuchuser/x                             | ~nosuchuser
evaluate resume=x                                       | resume=x | epuckhebb evolve resume=RUN | hydra.sweep.dir
evaluate -m resume=x seed=1,2                           | resume=x
evaluate environment=cartpole resume=x                  | resume=x
play resume=x                                           | resume=x
sweep light resume=x                                    | resume=x
sweep my_studies.py:Mine resume=x                       | resume=x
leaderboard obstacles resume=x                          | resume=x
reproduce resume=x                                      | resume=x
flock resume=x                                          | resume=x
reproduce genome=layers.npz                             | layers.npz
replay latest                                           | epuckhebb evaluate
rerun latest                                            | epuckhebb ev
show nothing                                            | nothing
show empty                                              | empty
export RUN                                              | epuckhebb export RUN --webots
evaluate --config-dir=nowhere                           | --config-dir=nowhere
evaluate -m seed=1,2 --config-dir=nowhere               | --config-dir=nowhere
sweep obstacles --config-dir=nowhere                    | --config-dir=nowhere
# files of the user's: settings
evaluate scenario=misspelt --config-dir=conf            | scenario.ligth
evaluate scenario=in_words --config-dir=conf            | scenario.light
evaluate scenario=from_none --config-dir=conf           | scenario/from_none | 2obstacle
evaluate scenario=too_deep --config-dir=conf            | scenario.scenario
evaluate scenario=number --config-dir=conf              | scenario/number
evaluate scenario=dotted --config-dir=conf              | lamp: {{x_m: ...}}
sweep no_package --config-dir=conf                      | experiment/no_package | _global_
sweep text --config-dir=conf                            | experiment=text
sweep pattern --config-dir=conf                         | scenario=glob(*)
sweep alone --config-dir=conf                           | alone | evaluate
# files of the user's: rules
evaluate hebbian.rule=nowhere.py:oja                    | hebbian.rule | nowhere.py
evaluate hebbian.rule=syntax.py:oja                     | syntax.py, line 2 | SyntaxError
evaluate hebbian.rule=raising.py:oja                    | raising.py, line 2 | boom
evaluate hebbian.rule=text.txt:oja                      | text.txt | .py
evaluate hebbian.rule=my_rules.py:hebb                  | hebb | oja
evaluate hebbian.rule=my_rules.py                       | FILE.py:NAME
evaluate hebbian.rule=unknown.py:oja                    | prae | pre, post, weight
evaluate {OJA} hebbian.decya=1                          | hebbian.decya | decay
evaluate {OJA} hebbian.decay=fast                       | hebbian.decay | fast
evaluate "compare.a={{rule: nowhere.py:b}}"             | compare.a.rule | nowhere.py
# what Hydra would take elsewhere, or ignore
evaluate -m seed=1,2 hydra.run.dir=mine                 | hydra.run.dir=mine | hydra.sweep.dir
evaluate ++hydra.sweep.dir=mine                         | hydra.sweep.dir=mine | hydra.run.dir
evaluate -m seed=interval(1,3)                          | seed=interval(1,3) | range
evaluate seed=interval(1,3)                             | seed=interval(1,3) | range
sweep light hydra.run.dir=mine                          | hydra.run.dir=mine | hydra.sweep.dir
evaluate -m scenario=glob(*obst*)                       | scenario=glob(*obst*) | values
# values that are no numbers, words that are no settings
evaluate seed=1-5                                       | seed | whole number
evaluate -m seed=1..5                                   | seed | whole number
evaluate hebbian.N=abc                                  | hebbian.N | number
evaluate scenario=highlight ~scenario.light             | scenario.light
evaluate scenario = lowlight                            | scenario | spaces
evaluate --scenario lowlight                            | --scenario | scenario=
evaluate -m genome=reference_1,nowhere.npy,nobody       | nowhere.npy | nobody
evaluate -m "seed=${{hydra:job.num}}" repeats=1,2         | seed | hydra
# launchers and options
evaluate -m hydra/launcher=ray seed=1,2                 | epuckhebb[ray]
evaluate experiment=n_sweep                             | epuckhebb sweep n_sweep
evaluate -m --cfg job seed=1,2                          | --cfg | --multirun
evaluate --cfg everything                               | everything | job
sweep light hydra/sweeper=basic                         | hydra/sweeper=basic
sweep light hydra/launcher=nope                         | nope | joblib
sweep light scenario.light=range(1,3),range(1,4)        | scenario.light
"""
SECTIONS = [[line.split("|") for line in lines.splitlines()] for lines in re.split(r"^# .*\n", REFUSED, flags=re.M)]
CASES = [case for section in SECTIONS[1:] for case in first_of(section, 3)]  # each composes settings anew


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with files of a user's."""
    folder = tmp_path_factory.mktemp("place")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    np.save(folder / "short.npy", np.zeros(227))
    np.save(folder / "zeros.npy", np.zeros(234))
    np.save(folder / "nan.npy", np.where(np.arange(234) == 5, np.nan, 0.0))
    np.savez(folder / "layers.npz", genome=np.zeros(234), layers=[16, 8, 2])
    np.savez(folder / "lidar.npz", genome=np.zeros(280), layers=[32, 8, 2], robot="epuck_lidar", lights=8)
    np.save(folder / "far.npy", np.full(234, 244.0))
    np.save(folder / "long.npy", np.full(234, np.longdouble("1e400")))
    np.savez(folder / "lights.npz", genome=np.zeros(234), layers=[16, 7, 5, 8, 4, 2], robot="epuck", lights=3)
    np.savez(folder / "pole.npz", genome=np.zeros(234), layers=[16, 7, 5, 8, 4, 2], environment="cartpole")
    sizes = {"parts": ["weights", "A", "B", "C", "D", "eta"], "part_sizes": [234] * 6}
    strong = np.concatenate([np.zeros(234), np.full(234, -10.0), np.zeros(4 * 234)])
    np.savez(folder / "strong.npz", genome=strong, layers=[16, 7, 5, 8, 4, 2], rule="abcd", **sizes)
    with zipfile.ZipFile(folder / "zeros.npz", "w") as two, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(2):
            two.write(folder / "zeros.npy", "genome.npy")
    np.savez(folder / "broken.npz", genome=np.zeros(234), memory_away_s=np.zeros(3))
    (folder / "light.npz").write_bytes(champion_file(load_genome("reference", "light"), 1.0, 1, 99))
    return folder


@pytest.mark.parametrize("case", CASES, ids=lambda case: " ".join(case[0].split()))
def test_a_mistake_gets_one_message_and_leaves_nothing(place, monkeypatch, case):
    monkeypatch.chdir(place)
    command, *named = case
    before = contents()
    result = refused(*shlex.split(command))
    for name in named:
        assert name.strip() in result
    assert len(result.splitlines()) <= 10
    assert "Traceback" not in result
    assert contents() == before


@pytest.mark.parametrize("words", [["evaluate"], ["evolve"], ["sweep", "light"]])
def test_what_is_no_text_is_refused(here, words):
    assert "encoding" in refused(*words, "scenario.name='a\udcff'")
    assert list(here.iterdir()) == []


def test_an_unknown_option_is_refused(here):
    result = call("evaluate", "--bogus")
    assert (result.exit_code, "--bogus" in result.stderr) == (2, True)
    assert list(here.iterdir()) == []


def test_an_error_that_is_its_own_cause_is_told_once():
    """As OmegaConf makes them under a debugger, or with OC_CAUSE=1."""
    error, cause = ValueError("outer"), KeyError("inner")
    error.__cause__, cause.__cause__ = cause, cause
    assert explain(error) == "outer 'inner'"


def test_an_error_without_words_is_told_by_its_cause_or_its_kind():
    """As some damaged files make them."""
    error = RuntimeError()
    assert explain(error) == "RuntimeError"
    error.__cause__ = ValueError("why")
    assert explain(error) == "why"


@pytest.mark.parametrize(("plugin", "extra"), [("submitit_slurm", "slurm"), ("ray", "ray")])
def test_a_launcher_that_is_not_installed_is_told_with_what_installs_it(plugin, extra):
    """Also where a launcher of ours, with a name of its own, begins with that of the plug-in."""
    error = ValueError(f"In 'hydra/launcher/mine': Could not load 'hydra/launcher/{plugin}'.")
    assert f"epuckhebb[{extra}]" in explain(error)


def test_a_link_to_nothing_in_place_of_runs_is_named(here):
    (here / "runs").symlink_to(here / "nowhere")
    for words in (["evaluate", "lifetime.duration_s=2"], ["sweep", "light", "repeats=1"]):
        assert f"runs is a link to {here / 'nowhere'}" in refused(*words)


@pytest.mark.parametrize("wrong", ["scenario=bright", "change=[slip_lef]", "hydra/launcher=foo"])
def test_the_wrong_word_alone_is_named(wrong):
    with pytest.raises(ConfigError) as error:
        load_any("evaluate", ["lifetime.noise=0.5", wrong, "repeats=3"])
    assert str(error.value).startswith(f"{wrong}: ")
