// Draws a green square, and a red one with WebGPU where there is some.
self.onmessage = async ({ data }) => {
  if (data === "fail") throw new Error("told to fail");
  const [gpu, flat] = data;
  const pen = flat.getContext("2d");
  pen.fillStyle = "rgb(0, 200, 0)";
  pen.fillRect(0, 0, 200, 200);
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) {
    self.postMessage({ adapter: null });
    return;
  }
  const device = await adapter.requestDevice();
  const context = gpu.getContext("webgpu");
  context.configure({ device, format: navigator.gpu.getPreferredCanvasFormat() });
  let frames = 0;
  const draw = () => {
    const encoder = device.createCommandEncoder();
    const view = context.getCurrentTexture().createView();
    const clearValue = { r: 0.8, g: 0.1, b: 0.1, a: 1 };
    encoder.beginRenderPass({ colorAttachments: [{ view, loadOp: "clear", storeOp: "store", clearValue }] }).end();
    device.queue.submit([encoder.finish()]);
    frames += 1;
    if (frames < 10) requestAnimationFrame(draw);
    else self.postMessage({ adapter: adapter.info.architecture, frames });
  };
  requestAnimationFrame(draw);
};
