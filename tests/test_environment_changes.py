"""Changes of an environment against the truth: an environment made with the changed value, bit for bit."""

import xml.etree.ElementTree as ET
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.envs import mujoco as robots

from epuckhebb.config.compose import load_any
from epuckhebb.runtime import conf
from epuckhebb.worlds.changes import Faults, apply

mujoco.set_mju_user_warning(lambda _: None)  # else MuJoCo writes a file into the working folder
ASSETS = Path(robots.__file__).parent / "assets"


def changed(env, *changes):
    """An environment after these changes, which are of one lifetime."""
    env.reset(seed=0)
    faults = Faults(readings=["0", "1", "2", "3"])
    for change in changes:
        apply(change, env.unwrapped, faults, {})
    return env


def steps(env, count=200):
    """Observations and rewards of random steps, of as many episodes as they last."""
    rng, seen, seed, is_over = np.random.default_rng(1), [], 0, True
    space = env.action_space
    for _ in range(count):
        if is_over:
            seen.append(env.reset(seed=seed)[0])
            seed += 1
        drawn = rng.uniform(-1, 1, space.shape) if space.shape else int(rng.integers(space.n))
        observation, reward, ended, cut, _ = env.step(drawn)
        seen += [observation, np.array([reward])]
        is_over = ended or cut
    return np.concatenate(seen)


def edited(name, folder, edit):
    """A file of a robot of Gymnasium after an edit of its XML."""
    tree = ET.parse(ASSETS / name)
    edit(tree.getroot())
    tree.write(folder / name)
    return str(folder / name)


def of_model(text):
    """An environment, as far as changes see one, of a model of MuJoCo."""
    env = gymnasium.Env()
    env.model = mujoco.MjModel.from_xml_string(text)
    return env


def arrays(model):
    """All arrays of a model that are numbers."""
    named = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    return {name: each for name, each in named.items() if isinstance(each, np.ndarray) and each.dtype.kind in "fi"}


def assert_same(one, other):
    ours, theirs = arrays(one), arrays(other)
    assert [name for name in ours if not np.array_equal(ours[name], theirs[name])] == []


@pytest.mark.parametrize(
    ("name", "kind", "body"), [("hopper", "Hopper-v5", "foot"), ("walker2d_v5", "Walker2d-v5", "foot_left")]
)
def test_a_heavy_body_is_one_that_was_compiled_heavy(name, kind, body, tmp_path):
    def heavy(root):
        for geom in root.iter("geom"):
            if geom.get("name") == f"{body}_geom":
                geom.set("density", "4000")

    truth = gymnasium.make(kind, xml_file=edited(f"{name}.xml", tmp_path, heavy))
    ours = changed(gymnasium.make(kind), {"mass": {body: 4}})
    assert_same(ours.unwrapped.model, truth.unwrapped.model)
    found = steps(ours)
    np.testing.assert_array_equal(found, steps(truth))
    assert not np.array_equal(found, steps(gymnasium.make(kind)))


@pytest.mark.parametrize("factor", [0, 0.3, 2])
def test_a_motor_is_one_that_was_compiled_weak(factor, tmp_path):
    def weak(root):
        for motor in root.iter("motor"):
            if motor.get("joint") == "bthigh":
                motor.set("gear", repr(float(motor.get("gear")) * factor))

    truth = gymnasium.make("HalfCheetah-v5", xml_file=edited("half_cheetah.xml", tmp_path, weak))
    ours = changed(gymnasium.make("HalfCheetah-v5"), {"joint_strength": {"bthigh": factor}})
    np.testing.assert_array_equal(steps(ours), steps(truth))


@pytest.mark.parametrize("factor", [0.5, 0.3])
def test_friction_is_that_of_a_compiled_model(factor, tmp_path):
    whole = gymnasium.make("Hopper-v5").unwrapped.model

    def slippery(root):
        for geom in root.find("worldbody").iter("geom"):
            own = whole.geom(geom.get("name")).friction
            geom.set("friction", " ".join(repr(float(each) * factor) for each in own))

    truth = gymnasium.make("Hopper-v5", xml_file=edited("hopper.xml", tmp_path, slippery))
    ours = changed(gymnasium.make("Hopper-v5"), {"friction": factor})
    assert_same(ours.unwrapped.model, truth.unwrapped.model)
    np.testing.assert_array_equal(steps(ours), steps(truth))


SERVO = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <body><joint name="elbow" type="hinge" axis="0 1 0" damping="1"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/>
      <body pos=".2 0 0"><joint name="wrist" type="hinge" axis="0 1 0" damping="1"/>
        <geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/><site name="tip" pos=".2 0 0"/></body></body>
  </worldbody>
  <tendon><fixed name="both"><joint joint="elbow" coef="1"/><joint joint="wrist" coef="1"/></fixed></tendon>
  <actuator>{actuators}</actuator>
</mujoco>
"""


def moved(model, controls, count=500):
    """The joints of a model after some steps."""
    data = mujoco.MjData(model)
    data.ctrl[:] = controls
    places = []
    for _ in range(count):
        mujoco.mj_step(model, data)
        places.append(data.qpos.copy())
    return np.array(places)


@pytest.mark.parametrize(
    ("actuator", "weak"),
    [
        ('<position joint="elbow" kp="{}" kv="{}" forcerange="{} {}"/>', (5.0, 0.5, -1.0, 1.0)),
        ('<velocity joint="elbow" kv="{}" forcerange="{} {}"/>', (5.0, -0.5, 0.5)),
        ('<general joint="elbow" gaintype="affine" gainprm="{} {}" forcerange="{} {}"/>', (3.0, 0.5, -1.0, 1.0)),
        ('<general joint="elbow" gear="3" armature=".2" damping=".1" gainprm="{}"/>', (1.0,)),
        ('<muscle joint="elbow" force="{}" lengthrange="-1 1"/>', (20.0,)),
        ('<muscle joint="elbow" scale="{}" lengthrange="-1 1"/>', (20.0,)),
    ],
)
def test_a_weak_servo_goes_where_a_weak_one_goes(actuator, weak):
    ours, truth = (SERVO.format(actuators=actuator.format(*(f * each for each in weak))) for f in (1.0, 0.5))
    env, compiled = of_model(ours), mujoco.MjModel.from_xml_string(truth)
    before = moved(env.model, [0.7])
    apply({"joint_strength": {"elbow": 0.5}}, env, Faults(readings=["0", "1", "2", "3"]), {})
    assert_same(env.model, compiled)
    after = moved(env.model, [0.7])
    np.testing.assert_array_equal(after, moved(compiled, [0.7]))
    assert not np.array_equal(after, before)


def test_motors_of_a_joint_are_those_that_act_on_it():
    motors = (
        '<motor name="pull" tendon="both"/><motor name="push" site="tip" gear="1 0 0 0 0 0"/>'
        '<motor name="one" joint="wrist"/><motor joint="wrist" gear="2"/>'
    )
    env, faults = of_model(SERVO.format(actuators=motors)), Faults(readings=["0", "1", "2", "3"])
    apply({"joint_strength": {"wrist": 0.5}}, env, faults, {})
    assert list(env.model.actuator_gear[:, 0]) == [1, 1, 0.5, 1]
    apply({"joint_strength": {"pull": 0.25, "push": 0, "one": 2}}, env, faults, {})
    assert list(env.model.actuator_gear[:, 0]) == [0.25, 0, 2, 1]
    for name in ("elbow", "both", "tip"):
        with pytest.raises(ValueError, match="wrist"):
            apply({"joint_strength": {name: 0.5}}, env, faults, {})


def test_a_motor_that_is_none_of_the_known_kinds_is_refused():
    env = of_model(SERVO.format(actuators='<general joint="elbow" gaintype="user"/>'))
    with pytest.raises(ValueError, match=r"joint_strength.*mjGAIN_USER"):
        apply({"joint_strength": {"elbow": 0.5}}, env, Faults(readings=["0", "1", "2", "3"]), {})


PAIR = """
<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body><freejoint/><geom name="ball" size=".1"/></body></worldbody>
<contact><pair geom1="floor" geom2="ball" friction="{0} {0} {1} {2} {2}"/></contact></mujoco>
"""


def test_friction_reaches_pairs_with_their_own():
    env = of_model(PAIR.format(0.8, 0.008, 0.0002))
    apply({"friction": 0.5}, env, Faults(readings=["0", "1", "2", "3"]), {})
    truth = mujoco.MjModel.from_xml_string(PAIR.format(0.4, 0.004, 0.0001))
    np.testing.assert_array_equal(env.model.pair_friction, truth.pair_friction)


@pytest.mark.parametrize("change", [{"mass": {"bthigh": 1}}, {"joint_strength": {"bthigh": 1}}, {"friction": 1}])
def test_a_factor_of_one_repairs_what_an_earlier_change_broke(change):
    (name,) = change
    strong = 0.3 if name == "friction" else {"bthigh": 0.3}
    ours = changed(gymnasium.make("HalfCheetah-v5"), {name: strong}, {name: strong}, change)
    whole = gymnasium.make("HalfCheetah-v5")
    assert_same(ours.unwrapped.model, whole.unwrapped.model)
    np.testing.assert_array_equal(steps(ours), steps(whole))
    broken = changed(gymnasium.make("HalfCheetah-v5"), {name: strong}, {name: strong}).unwrapped.model
    once = changed(gymnasium.make("HalfCheetah-v5"), {name: strong}).unwrapped.model
    assert_same(broken, once)


def test_gravity_is_that_of_a_compiled_model(tmp_path):
    truth = gymnasium.make(
        "Hopper-v5", xml_file=edited("hopper.xml", tmp_path, lambda root: root.find("option").set("gravity", "0 0 -3"))
    )
    np.testing.assert_array_equal(steps(changed(gymnasium.make("Hopper-v5"), {"gravity": 3})), steps(truth))


def test_a_pendulum_is_one_that_was_made_so():
    truth, ours = gymnasium.make("Pendulum-v1", g=3.0), changed(gymnasium.make("Pendulum-v1"), {"g": 3})
    np.testing.assert_array_equal(steps(ours), steps(truth))


def test_a_lander_falls_with_its_new_gravity():
    pytest.importorskip("Box2D")
    ours, truth = (
        changed(gymnasium.make("LunarLander-v3"), {"gravity": 1.6}),
        gymnasium.make("LunarLander-v3", gravity=-1.6),
    )
    truth.reset(seed=0)
    assert ours.unwrapped.world.gravity == truth.unwrapped.world.gravity
    rates = []
    for env in (ours, truth):
        speeds = [env.step(0)[0][3] for _ in range(20)]
        rates.append(np.diff(speeds))
    np.testing.assert_allclose(*rates, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "change", "text"),
    [
        ("Acrobot-v1", {"LINK_LENGTH_2": 2.0}, "LINK_LENGTH_2"),
        ("CartPole-v1", {"total_mass": 2.0}, "total_mass"),
        ("CartPole-v1", {"screen_width": 300}, "screen_width"),
        ("Ant-v5", {"healthy_reward": 2.0}, "healthy_reward"),
        ("Ant-v5", {"dt": 0.1}, "dt"),
        ("Ant-v5", {"np_random_seed": 3}, "np_random_seed"),
        ("HalfCheetah-v5", {"width": 3}, "width"),
        ("HalfCheetah-v5", {"dead_readings": 2}, "dead_readings"),
        ("HalfCheetah-v5", {"dead_readings": [True]}, "dead_readings"),
        ("HalfCheetah-v5", {"noisy_readings": {4: 0.1}}, "0 to 3"),
        ("HalfCheetah-v5", {"mass": {}}, "mass"),
        ("HalfCheetah-v5", {"action_delay": 1.5}, "action_delay"),
        ("CliffWalking-v1", {"is_slippery": 3}, "true or false"),
    ],
)
def test_what_cannot_change_is_refused(kind, change, text):
    with pytest.raises(ValueError, match=text) as refusal:
        changed(gymnasium.make(kind), change)
    assert f", {text}," not in str(refusal.value)  # it is no name among those that act


def test_a_number_keeps_its_type():
    env = changed(gymnasium.make("HalfCheetah-v5"), {"frame_skip": np.int64(2)}).unwrapped
    assert (type(env.frame_skip), env.frame_skip) == (int, 2)
    env = changed(gymnasium.make("CartPole-v1"), {"length": np.float64(2)}).unwrapped
    assert (env.length, env.polemass_length) == (2.0, 0.2)


ROWS = conf.table("environment")
NAMED = [(row, change) for row, settings in ROWS.items() for change in (settings or {}).get("named", {})]


@pytest.mark.parametrize(("row", "change"), NAMED)
def test_a_named_change_acts(row, change):
    package, has_package, _ = ROWS[row]["id"].partition(":")
    if row == "lunar_lander" or has_package:
        pytest.importorskip("Box2D" if row == "lunar_lander" else package)
    horizon = 2 * ({**ROWS["gym"], **ROWS[row]})["horizon"]  # as `evaluate` has it
    words = [f"environment={row}", f"change={change}", f"environment.horizon={horizon}"]
    assert [note for note in load_any("evolve", words).world.findings.notes if "changes nothing" in note] == []
