//! What JavaScript sees. Structured data crosses as JSON, errors as `Error` with a message for people.
#![allow(unsafe_code)]

use js_sys::{Float32Array, Promise, Reflect, Uint8Array, Uint8ClampedArray, Uint32Array};
use serde::Serialize;
use std::cell::Cell;
use viscera::scalar::vec3;
use wasm_bindgen::prelude::*;
use web_sys::OffscreenCanvas;

use viscera_stage::Drag;

use crate::screen::{Screen, open_device};
use crate::session::{Grip, MOST_FILE_BYTES, MOST_TETS};
use crate::{LoadRequest, catalog, choose as choosing, session};

thread_local! {
    static HOOKED: Cell<bool> = const { Cell::new(false) };
}

/// A panic says in the console what it was about; the page only hears of an unreachable instruction.
fn explain_panics() {
    if !HOOKED.replace(true) {
        std::panic::set_hook(Box::new(|panic| {
            web_sys::console::error_1(&panic.to_string().into());
        }));
    }
}

fn error(message: impl AsRef<str>) -> JsError {
    JsError::new(message.as_ref())
}

fn json(value: &impl Serialize) -> Result<String, JsError> {
    serde_json::to_string(value).map_err(|e| error(e.to_string()))
}

/// The built-in scenes.
#[wasm_bindgen]
pub fn scenes() -> Result<String, JsError> {
    json(&catalog::scenes())
}

/// The settings of solver and world.
#[wasm_bindgen]
pub fn settings() -> Result<String, JsError> {
    json(&catalog::settings())
}

/// Tissues of the literature.
#[wasm_bindgen]
pub fn presets() -> Result<String, JsError> {
    json(&catalog::presets())
}

/// What is refused beyond.
#[wasm_bindgen]
pub fn limits() -> String {
    format!("{{\"fileBytes\":{MOST_FILE_BYTES},\"tets\":{MOST_TETS}}}")
}

/// Device, mesh and accuracy for a frame rate.
#[wasm_bindgen]
pub fn choose(measured: &str) -> Result<String, JsError> {
    let measured = serde_json::from_str(measured).map_err(|e| error(e.to_string()))?;
    json(&choosing::choose(&measured))
}

#[derive(Serialize)]
struct DeviceReport {
    name: Option<String>,
    software: bool,
    missing: Option<String>,
}

/// One scene in motion, or two beside each other, and a picture of them.
#[wasm_bindgen]
pub struct Session {
    session: session::Session,
    screen: Option<Screen>,
    canvas: Option<OffscreenCanvas>,
    /// Why there is no device.
    missing: Option<String>,
    /// Surfaces as flat numbers, in the same memory as long as their size is the same.
    positions: Vec<Vec<f32>>,
}

#[wasm_bindgen]
impl Session {
    /// Opens the browser's device, where it has one, and draws onto the canvas, where one is given.
    pub async fn open(canvas: Option<OffscreenCanvas>) -> Result<Session, JsError> {
        explain_panics();
        let session = session::Session::new(None);
        let mut opened =
            Self { session, screen: None, canvas, missing: None, positions: Vec::new() };
        opened.connect().await?;
        Ok(opened)
    }

    /// Opens without a device, at once: the CPU computes. For places that have none, and pages that draw by themselves.
    #[wasm_bindgen(js_name = onCpu)]
    pub fn on_cpu() -> Session {
        explain_panics();
        let missing = Some("This session was opened without a graphics processor.".to_owned());
        let session = session::Session::new(None);
        Self { session, screen: None, canvas: None, missing, positions: Vec::new() }
    }

    async fn connect(&mut self) -> Result<(), JsError> {
        self.screen = None;
        match open_device().await {
            Ok((instance, device)) => {
                if let Some(canvas) = &self.canvas {
                    let screen = Screen::new(&instance, &device, canvas.clone());
                    self.screen = Some(screen.map_err(error)?);
                }
                self.missing = None;
                self.session.put_device(Some(device)).map_err(error)
            }
            Err(reason) => {
                self.missing = Some(missing(&reason));
                self.session.put_device(None).map_err(error)
            }
        }
    }

    /// The device, or why there is none.
    pub fn device(&self) -> Result<String, JsError> {
        let device = self.session.device();
        json(&DeviceReport {
            name: device.map(|device| device.name().to_owned()),
            software: device.is_some_and(viscera::solver::gpu::Device::is_software),
            missing: self.missing.clone(),
        })
    }

    /// Why the device is gone, once it is.
    pub fn lost(&self) -> Option<String> {
        self.session.lost()
    }

    /// Another device in its place; every simulation goes on where it was. A canvas in place of the last one, where one is
    /// given: browsers whose graphics process died give pictures of theirs to new canvases only.
    pub async fn reopen(&mut self, canvas: Option<OffscreenCanvas>) -> Result<(), JsError> {
        self.canvas = canvas.or(self.canvas.take());
        self.connect().await
    }

    /// Gives the device back, as if it were lost.
    #[wasm_bindgen(js_name = loseDevice)]
    pub fn lose_device(&self) {
        if let Some(device) = self.session.device() {
            device.wgpu().0.destroy();
        }
    }

    /// Loads a scene; `balance` is what the second module has found for it.
    pub fn load(
        &mut self,
        request: &str,
        files: JsValue,
        balance: Option<Vec<u8>>,
    ) -> Result<(), JsError> {
        let request: LoadRequest =
            serde_json::from_str(request).map_err(|e| error(format!("this is no request: {e}")))?;
        let mut load = |name: &str| {
            let file = Reflect::get(&files, &name.into()).unwrap_or(JsValue::UNDEFINED);
            match file.dyn_into::<Uint8Array>() {
                Ok(bytes) => Ok(bytes.to_vec()),
                Err(_) => {
                    Err(format!("{name}: there is no such file; drop it together with the scene"))
                }
            }
        };
        self.session.load(&request, &mut load, balance.as_deref()).map_err(error)?;
        self.positions.clear();
        Ok(())
    }

    /// What was loaded.
    pub fn loaded(&self) -> Result<String, JsError> {
        json(&self.session.loaded())
    }

    /// Changes a setting.
    pub fn set(&mut self, run: usize, key: String, value: String) -> Result<(), JsError> {
        self.session.set(run, &vec![(key, value)]).map_err(error)
    }

    /// Changes several settings at once: pairs of keys and values.
    #[wasm_bindgen(js_name = setAll)]
    pub fn set_all(&mut self, run: usize, settings: &str) -> Result<(), JsError> {
        self.session.set(run, &pairs(settings)?).map_err(error)
    }

    /// A setting as it stands.
    pub fn setting(&mut self, run: usize, key: &str) -> Result<String, JsError> {
        self.session.setting(run, key).map_err(error)
    }

    /// Begins from rest.
    pub fn reset(&mut self) -> Result<(), JsError> {
        self.session.reset().map_err(error)
    }

    /// A second simulation beside the first, or none.
    pub fn beside(&mut self, settings: Option<String>) -> Result<(), JsError> {
        let settings = settings.map(|text| pairs(&text)).transpose()?;
        self.session.beside(settings.as_ref()).map_err(error)
    }

    /// How many simulations there are.
    pub fn runs(&self) -> usize {
        self.session.run_count()
    }

    /// False while a frame is under way.
    pub fn ready(&mut self) -> Result<bool, JsError> {
        self.session.ready().map_err(error)
    }

    /// Begins a frame of one simulation.
    pub fn advance(&mut self, run: usize) -> Result<(), JsError> {
        self.session.advance(run).map_err(error)
    }

    /// Resolves when the device has done all that it was sent.
    pub fn settled(&self) -> Promise {
        match self.session.device() {
            None => Promise::resolve(&JsValue::UNDEFINED),
            Some(device) => Promise::new(&mut |resolve, _| {
                device.wgpu().1.on_submitted_work_done(move || {
                    // A page that is gone does not listen.
                    let _ = resolve.call0(&JsValue::UNDEFINED);
                });
            }),
        }
    }

    /// Brings the report's measures up to date with the next frame.
    pub fn measure(&mut self) {
        self.session.measure();
    }

    /// Numbers of now.
    pub fn report(&self) -> Result<String, JsError> {
        json(&self.session.report())
    }

    /// How hands take hold from now on.
    pub fn grip(&mut self, count: u32, stiffness: f64, rigid: bool) {
        self.session.set_grip(Grip { count, stiffness: (!rigid).then_some(stiffness) });
    }

    /// Takes hold of what is seen at a place of the canvas [pixels].
    pub fn grab(&mut self, id: u32, x: f64, y: f64) -> Result<bool, JsError> {
        self.session.grab(id.into(), [x, y]).map_err(error)
    }

    /// Leads a hand to a place of the canvas [pixels].
    pub fn lead(&mut self, id: u32, x: f64, y: f64) -> Result<(), JsError> {
        self.session.lead(id.into(), [x, y]).map_err(error)
    }

    /// Takes hold near a point [m].
    #[wasm_bindgen(js_name = grabAt)]
    pub fn grab_at(&mut self, id: u32, x: f64, y: f64, z: f64) -> Result<bool, JsError> {
        self.session.grab_at(id.into(), vec3(x, y, z)).map_err(error)
    }

    /// Leads a hand so far from where it took hold [m].
    #[wasm_bindgen(js_name = leadBy)]
    pub fn lead_by(&mut self, id: u32, dx: f64, dy: f64, dz: f64) -> Result<(), JsError> {
        self.session.lead_by(id.into(), vec3(dx, dy, dz)).map_err(error)
    }

    /// The names of the instruments on the tray.
    pub fn tray(&self) -> Result<String, JsError> {
        json(&self.session.tray())
    }

    /// Instruments in hands.
    #[wasm_bindgen(js_name = inHand)]
    pub fn in_hand(&self) -> Result<String, JsError> {
        json(&self.session.in_hand())
    }

    /// What a person should know of instruments since this was last asked.
    pub fn told(&mut self) -> Option<String> {
        self.session.told()
    }

    /// Takes the instrument of this number from the tray.
    #[wasm_bindgen(js_name = takeTool)]
    pub fn take_tool(&mut self, number: usize) -> Result<(), JsError> {
        self.session.take_tool(number).map_err(error)
    }

    /// Whether a pointer at a place of the canvas [pixels] leads an instrument.
    #[wasm_bindgen(js_name = pressTool)]
    pub fn press_tool(&mut self, x: f64, y: f64, anywhere: bool) -> Result<bool, JsError> {
        self.session.press_tool([x, y], anywhere).map_err(error)
    }

    /// Drags the active instrument from one place of the canvas to another [pixels]: "across", "depth", "tilt" or "roll".
    #[wasm_bindgen(js_name = dragTool)]
    pub fn drag_tool(
        &mut self,
        x0: f64,
        y0: f64,
        x1: f64,
        y1: f64,
        kind: &str,
    ) -> Result<(), JsError> {
        let drag = match kind {
            "across" => Drag::Across,
            "depth" => Drag::Depth,
            "tilt" => Drag::Tilt,
            "roll" => Drag::Roll,
            other => {
                return Err(error(format!("a drag is across, depth, tilt or roll, not `{other}`")));
            }
        };
        self.session.drag_tool([[x0, y0], [x1, y1]], drag).map_err(error)
    }

    /// Opens the jaws of the active instrument by so much [rad].
    #[wasm_bindgen(js_name = openJaws)]
    pub fn open_jaws(&mut self, by: f64) -> Result<(), JsError> {
        self.session.open_jaws(by).map_err(error)
    }

    /// Locks its jaws, or unlocks them.
    #[wasm_bindgen(js_name = lockJaws)]
    pub fn lock_jaws(&mut self) -> Result<(), JsError> {
        self.session.lock_jaws().map_err(error)
    }

    /// Makes the instrument of a hand active, or the next one.
    #[wasm_bindgen(js_name = activateTool)]
    pub fn activate_tool(&mut self, hand: Option<u32>) {
        self.session.activate_tool(hand.map(u64::from));
    }

    /// Puts the active instrument away.
    #[wasm_bindgen(js_name = putAway)]
    pub fn put_away(&mut self) -> Result<(), JsError> {
        self.session.put_away().map_err(error)
    }

    /// Lets go.
    pub fn release(&mut self, id: u32) -> Result<(), JsError> {
        self.session.release(id.into()).map_err(error)
    }

    /// The force of a hand [N].
    pub fn force(&self, id: u32) -> Vec<f64> {
        self.session.force(id.into()).to_array().to_vec()
    }

    /// Turns the view.
    pub fn orbit(&mut self, dx: f64, dy: f64) {
        self.session.turn(dx, dy);
    }

    /// Moves the view.
    pub fn pan(&mut self, dx: f64, dy: f64) {
        self.session.pan(dx, dy);
    }

    /// Goes nearer, with a factor below 1, or farther.
    pub fn zoom(&mut self, factor: f64) {
        self.session.zoom(factor);
    }

    /// Looks at everything.
    pub fn home(&mut self) {
        self.session.home();
    }

    /// The picture's size [pixels].
    pub fn resize(&mut self, width: u32, height: u32) {
        self.session.resize(width, height);
    }

    /// Dark or light behind the tissue.
    pub fn theme(&mut self, dark: bool) {
        self.session.set_dark(dark);
    }

    /// What colours show.
    pub fn color(&mut self, kind: &str) -> Result<(), JsError> {
        self.session.color(kind).map_err(error)
    }

    /// Whether edges are drawn.
    pub fn wireframe(&mut self, on: bool) {
        self.session.show_wireframe(on);
    }

    /// The colours' scale, or null.
    pub fn legend(&self) -> Result<String, JsError> {
        #[derive(Serialize)]
        struct Scale {
            title: String,
            low: f32,
            high: f32,
            text: String,
        }
        let scale = self.session.legend();
        json(&scale.map(|(title, high, text)| Scale { title, low: 0.0, high, text }))
    }

    /// Draws onto the canvas.
    pub fn draw(&mut self) -> Result<(), JsError> {
        match &mut self.screen {
            Some(screen) if self.session.lost().is_none() => {
                screen.draw(&mut self.session).map_err(error)
            }
            _ => Ok(()),
        }
    }

    /// The picture's colours, drawn without a device.
    pub fn pixels(&self) -> Uint8ClampedArray {
        Uint8ClampedArray::from(self.session.pixels().as_slice())
    }

    /// The surface's vertices [m], three numbers each: a view of the module's memory.
    pub fn positions(&mut self, run: usize) -> Result<Float32Array, JsError> {
        let surface = self.session.surface(run).map_err(error)?;
        if self.positions.len() <= run {
            self.positions.resize(run + 1, Vec::new());
        }
        let flat = &mut self.positions[run];
        flat.clear();
        flat.extend(surface.iter().flat_map(|x| x.to_array()));
        // SAFETY: the view is of memory that this session keeps; JavaScript asks again when memory has grown.
        Ok(unsafe { Float32Array::view(flat) })
    }

    /// The surface's triangles.
    pub fn triangles(&self) -> Uint32Array {
        Uint32Array::from(self.session.triangles().as_flattened())
    }

    /// The tetrahedra's vertices [m], three numbers each.
    pub fn vertices(&self, run: usize) -> Result<Float32Array, JsError> {
        let vertices = self.session.vertices(run).map_err(error)?;
        let flat: Vec<f32> = vertices.iter().flat_map(|x| x.to_array()).collect();
        Ok(Float32Array::from(flat.as_slice()))
    }

    /// A scene file that repeats all that was done by hand.
    pub fn replay(&self) -> Result<String, JsError> {
        self.session.replay().map_err(error)
    }

    /// The way from the viewer through a place of the canvas [pixels]: where it begins [m] and its direction, six numbers.
    pub fn ray(&self, x: f64, y: f64) -> Vec<f64> {
        let (from, direction) = self.session.ray([x, y]);
        [from.to_array(), direction.to_array()].concat()
    }

    /// Where a point [m] is seen on the canvas [pixels]; empty where it is not.
    pub fn seen(&self, run: usize, x: f64, y: f64, z: f64) -> Vec<f64> {
        self.session.seen(run, vec3(x, y, z)).map_or_else(Vec::new, |place| place.to_vec())
    }
}

fn pairs(settings: &str) -> Result<Vec<(String, String)>, JsError> {
    serde_json::from_str(settings)
        .map_err(|e| error(format!("these are no pairs of settings: {e}")))
}

/// Why there is no device, and what to do.
fn missing(reason: &viscera::solver::gpu::GpuError) -> String {
    use viscera::solver::gpu::GpuError;
    let what = match reason {
        GpuError::NoAdapter => {
            "This browser offers no graphics processor to pages (WebGPU): it is too old, has it switched off, or the \
             page came without https"
                .to_owned()
        }
        other => other.to_string().split("; use").next().unwrap_or_default().to_owned(),
    };
    format!(
        "{what}. The CPU computes and draws; a recent Chrome, Edge, Safari or Firefox over https is faster."
    )
}
