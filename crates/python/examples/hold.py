"""Take hold of a liver by a spring of 200 N/m, pull, and print how force and place go together."""

import numpy as np
import viscera as vi

simulation = vi.Simulation(vi.Scene.builtin("liver_lifted"))
simulation.advance(10)
liver = simulation["liver"]
# The vertex at the liver's left end.
vertex = int(np.argmin(liver.rest[:, 0]))
with simulation.take_hold("liver", vertex=vertex, count=6, stiffness="200 N/m") as hold:
    for step in range(1, 31):
        hold.lead([-0.001 * step, 0.0, 0.0])
        simulation.advance()
        if step % 10 == 0:
            print(f"led by {step} mm: {np.linalg.norm(hold.force):.2f} N")
