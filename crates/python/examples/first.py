"""Lift a liver with a retractor; print the force and write a picture."""

from pathlib import Path

import viscera as vi

scene = vi.Scene.builtin("liver_retraction")
scene["body.liver.material.young"] = "6.5 kPa"
simulation = vi.Simulation(scene)
frame = simulation.advance(frames=60)
print(frame)
print("force on the liver [N]:", simulation.force("retractor"))
Path("liver.png").write_bytes(simulation.picture())
