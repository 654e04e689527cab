//! What a browser's compiler makes of kernels, whether a scene takes them or not.

use serde_json::Value;
use viscera::solver::gpu::kernels::texts;

use crate::browser::Kind;
use crate::setup;

/// It looks at more than wgpu's own does: whether it is certain that all threads of a workgroup come to a barrier.
#[test]
fn the_browser_compiles_every_kernel() {
    let Some((tab, url)) = setup::page(Kind::Gpu) else { return };
    // A text of the same server: nothing else keeps the device busy.
    tab.expect("favicon.ico");
    tab.go(&format!("{url}offline.js"));
    let device = "navigator.gpu.requestAdapter().then((adapter) => adapter.requestDevice())\
                  .then((device) => { window.compiler = device; return true; })";
    assert_eq!(tab.evaluate(device), true);
    let texts = texts();
    let solves = ["take_trial", "choose_direction", "find_contacts", "recover_gradients"];
    for kernel in solves {
        let is_it = |(name, _): &(String, String)| name.starts_with(kernel);
        assert!(texts.iter().any(is_it), "{kernel} is among them");
    }
    for (name, text) in texts {
        let code = Value::from(text);
        let errors = tab.evaluate(&format!(
            "(async () => {{ const module = compiler.createShaderModule({{ code: {code} }}); \
             const {{ messages }} = await module.getCompilationInfo(); \
             const errors = messages.filter((message) => message.type === 'error'); \
             return errors.map((error) => `line ${{error.lineNum}}: ${{error.message}}`).join('\\n'); }})()"
        ));
        assert_eq!(errors, "", "{name}");
    }
}
