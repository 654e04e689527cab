//! A scene with ties, of the library's tests and the program's.

/// A plate over a block, 1.5 mm apart and tied; the plate's upper face is led.
pub const TIED: &str = r#"
[time]
duration = "1 s"
velocity_factor = 0.9
[world]
gravity = 0
[[body]]
name = "block"
shape = "block"
size = ["20 mm", "20 mm", "8 mm"]
cells = [4, 4, 2]
material = { young = "10 kPa", poisson = 0.4, viscosity = "5 ms" }
[[body]]
name = "plate"
shape = "block"
size = ["20 mm", "20 mm", "4 mm"]
cells = [4, 4, 1]
position = [0, 0, "9.5 mm"]
material = { young = "10 kPa", poisson = 0.4, viscosity = "5 ms" }
[[fixing]]
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
[[motion]]
name = "hand"
body = "plate"
half_space = { point = [0, 0, "13.5 mm"], normal = [0, 0, 1] }
keys = [{ time = "0.1 s" }, { time = "0.5 s", translation = [0, 0, "2 mm"] }]
[[tie]]
name = "bed"
from = { body = "plate", half_space = { point = [0, 0, "9.5 mm"], normal = [0, 0, -1] } }
to = { body = "block", half_space = { point = [0, 0, "8 mm"], normal = [0, 0, 1] } }
distance = "2 mm"
stiffness = "2 kPa/mm"
strength = "3 kPa"
"#;

/// The same with both bodies held as a whole: in the end ties of 2 kPa/mm are stretched by 2 mm, on 4 cm^2.
pub fn held() -> String {
    TIED.replace("point = [0, 0, \"13.5 mm\"]", "point = [0, 0, \"9 mm\"]")
        .replace("point = [0, 0, 0], normal", "point = [0, 0, \"8.5 mm\"], normal")
}
