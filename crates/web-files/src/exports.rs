//! What JavaScript sees.
#![allow(unsafe_code)]

use js_sys::{Function, Object, Reflect, Uint8Array};
use wasm_bindgen::prelude::*;

use crate::{Files, Request};

/// A panic says in the console what it was about; the page only hears of an unreachable instruction.
fn explain_panics() {
    std::panic::set_hook(Box::new(|panic| {
        web_sys::console::error_1(&panic.to_string().into());
    }));
}

/// A scene, and files that the page's first module reads.
#[wasm_bindgen]
pub struct Prepared(crate::Prepared);

#[wasm_bindgen]
impl Prepared {
    /// The scene file's name.
    #[wasm_bindgen(getter)]
    pub fn name(&self) -> String {
        self.0.name.clone()
    }

    /// The scene file.
    #[wasm_bindgen(getter)]
    pub fn text(&self) -> String {
        self.0.text.clone()
    }

    /// Its files as an object: bytes by name.
    #[wasm_bindgen(getter)]
    pub fn files(&self) -> Result<Object, JsValue> {
        let object = Object::new();
        for (name, bytes) in &self.0.files {
            Reflect::set(&object, &name.into(), &Uint8Array::from(&bytes[..]))?;
        }
        Ok(object)
    }

    /// How bodies carry gravity that rest as they are; nothing where none do.
    #[wasm_bindgen(getter)]
    pub fn balance(&self) -> Option<Vec<u8>> {
        self.0.balance.clone()
    }

    /// What people should know, a line each.
    #[wasm_bindgen(getter)]
    pub fn notes(&self) -> Vec<String> {
        self.0.notes.clone()
    }
}

/// A scene of files, an object with bytes by name; `observe` is called with what is being done.
#[wasm_bindgen]
pub fn prepare(request: &str, files: &Object, observe: &Function) -> Result<Prepared, JsError> {
    explain_panics();
    let request: Request = serde_json::from_str(request)
        .map_err(|e| JsError::new(&format!("this is no request: {e}")))?;
    let mut all = Files::new();
    for name in Object::keys(files) {
        let bytes = Reflect::get(files, &name).unwrap_or(JsValue::UNDEFINED);
        let bytes =
            bytes.dyn_into::<Uint8Array>().map_err(|_| JsError::new("bytes are missing"))?;
        all.insert(name.as_string().unwrap_or_default(), bytes.to_vec());
    }
    let mut tell = |doing: String| {
        // A page that is gone does not listen.
        let _ = observe.call1(&JsValue::UNDEFINED, &doing.into());
    };
    let prepared = crate::prepare(&request, &all, &mut tell);
    prepared.map(Prepared).map_err(|text| JsError::new(&text))
}
