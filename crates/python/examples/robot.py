"""A controller leads a probe by its pose and reads the force on it: press until it is 1 N, and keep it there.

The loop is that of any robot: pose in, wrench out, sixty times a second.
"""

import numpy as np
import viscera as vi

simulation = vi.Simulation(vi.Scene.builtin("palpation"))
probe = simulation.tool("probe")
wanted = 1.0
for _ in range(120):
    force = probe.wrench[2]
    pose = probe.pose
    # Down where it presses too little, up where too much; at most 1 mm a frame.
    pose[2, 3] -= np.clip((wanted - force) / 1500.0, -1e-3, 1e-3)
    probe.pose = pose
    simulation.advance()
error = probe.wrench_error
print(f"after {simulation.time:.1f} s the probe presses with {probe.wrench[2]:.3f} N")
if error is not None:
    print(f"of which {error[0]:.3f} N may be the simulation's own error")
