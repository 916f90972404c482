# MuJoCo: from 3.12 on, an enum on the left of `==` differs from the NumPy number that a model holds; on the right, it is equal.
set -- mujoco==4.0.0 numpy==2.4.*
. "$(dirname "$0")/run.sh" <<'PYTHON'
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
kind, free = model.jnt_type[0], mujoco.mjtJoint.mjJNT_FREE
seen = {"number == enum": bool(kind == free), "enum == number": bool(free == kind), "enum == int(number)": free == int(kind),
        "number in [enum]": kind in [free], "the same hash": hash(kind) == hash(free)}
print("mujoco", mujoco.__version__, repr(kind), repr(free), seen)
assert list(seen.values()) == [True, False, True, False, True]
PYTHON
