# MuJoCo: a new body_mass leaves body_invweight0 of the old one until mj_setConst, which sets the MjData it is given to the reference pose.
set -- mujoco==4.0.0
. "$(dirname "$0")/run.sh" <<'PYTHON'
import mujoco, numpy as np
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body pos='0 0 1'><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
data = mujoco.MjData(model)
before = model.body_invweight0[1, 0]
model.body_mass[1] *= 2
for _ in range(100): mujoco.mj_step(model, data)
fallen, kept = data.qpos[2], model.body_invweight0[1, 0]
mujoco.mj_setConst(model, data)
print("mujoco", mujoco.__version__, "invweight0:", before, "after the mass:", kept, "after setConst:", model.body_invweight0[1, 0])
print("height:", fallen, "after setConst:", data.qpos[2])
assert kept == before and np.isclose(model.body_invweight0[1, 0], before / 2)
assert fallen < 1.0 == data.qpos[2]
PYTHON
