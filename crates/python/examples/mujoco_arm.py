"""A MuJoCo arm presses a probe of ours into tissue: pose in, wrench out, in every frame.

Needs the MuJoCo wheel (pip install mujoco).
"""

import mujoco
import numpy as np
import viscera as vi

ARM = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body name="wrist" pos="0.02 0.04 0.045">
      <joint name="x" type="slide" axis="1 0 0" damping="20"/>
      <joint name="y" type="slide" axis="0 1 0" damping="20"/>
      <joint name="z" type="slide" axis="0 0 1" damping="20"/>
      <geom type="capsule" size="0.005" fromto="0 0 0 0 0 0.06" mass="0.2"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="x" kp="400"/> <position joint="y" kp="400"/> <position joint="z" kp="400"/>
  </actuator>
</mujoco>
"""
arm = mujoco.MjModel.from_xml_string(ARM)
data = mujoco.MjData(arm)
wrist = arm.body("wrist").id
tissue = vi.Simulation(vi.Scene.builtin("palpation"))
probe = tissue.tool("probe")
for frame in range(180):
    # The arm is asked to go 12 mm down in a second: into the tissue, which pushes back.
    data.ctrl[2] = -0.012 * min(frame / 60, 1.0)
    force, torque = np.split(probe.wrench, 2)
    data.xfrc_applied[wrist] = [*force, *torque]
    mujoco.mj_step(arm, data, nstep=round(tissue.frame_time / arm.opt.timestep))
    pose = np.eye(4)
    pose[:3, :3] = data.xmat[wrist].reshape(3, 3)
    pose[:3, 3] = data.xpos[wrist]
    probe.pose = pose
    tissue.advance()
push = -data.actuator_force[2]
print(f"the arm pushes with {push:.3f} N, the tissue with {probe.wrench[2]:.3f} N")
print(f"it is {1e3 * (data.qpos[2] - data.ctrl[2]):.2f} mm short of where it was asked to go")
