// Starts the dashboard: checks what the browser can do, loads the bundle with visible progress, hands the canvas over.
// All words that a person can see before the dashboard draws itself are here and in index.html.

const CANVAS_ID = "dashboard";
const BUNDLE = "/bundle/web_ui.js";
const WASM = "/bundle/web_ui_bg.wasm";
const CRASH_CHECK_MS = 1000;

const loading = document.getElementById("loading");
const text = document.getElementById("loading-text");
const detail = document.getElementById("loading-detail");
const bar = document.getElementById("loading-bar");

function megabytes(bytes) {
  return (bytes / 1e6).toFixed(1) + " MB";
}

function fail(sentence, technical) {
  loading.hidden = false;
  bar.hidden = true;
  text.textContent = sentence;
  text.className = "error";
  detail.textContent = technical ?? "";
  window.__robopheus = { failed: sentence + (technical ? " " + technical : "") };
}

function missingFeature() {
  if (typeof WebAssembly !== "object" || typeof WebAssembly.instantiate !== "function") {
    return "This browser has no WebAssembly. Please use a current Firefox, Chrome, Edge or Safari.";
  }
  const probe = document.createElement("canvas");
  const gl = probe.getContext("webgl2") ?? probe.getContext("webgl");
  if (!gl) {
    return "This browser offers no WebGL, which draws the dashboard. Switch on hardware acceleration or WebGL in the browser's settings, then reload.";
  }
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return null;
}

// The response as it streams in, with progress. The length is known when the server does not compress on the way.
async function download(url) {
  const response = await fetch(url);
  if (!response.ok) {
    throw new Error(`${url}: the server answered ${response.status} ${response.statusText}`);
  }
  const compressed = response.headers.get("content-encoding");
  const total = compressed ? 0 : Number(response.headers.get("content-length") ?? 0);
  if (!response.body) return response;
  let received = 0;
  const counted = response.body.pipeThrough(new TransformStream({
    transform(chunk, controller) {
      received += chunk.byteLength;
      if (total > 0) bar.value = received / total;
      detail.textContent = total > 0 ? `${megabytes(received)} of ${megabytes(total)}` : megabytes(received);
      controller.enqueue(chunk);
    },
  }));
  return new Response(counted, { headers: { "content-type": "application/wasm" } });
}

function watchForCrash(bundle) {
  const timer = setInterval(() => {
    const summary = bundle.crash_report();
    if (summary === undefined) return;
    clearInterval(timer);
    fail("The dashboard stopped because of an error in its program. Reload the page to go on; submitted runs are not affected.", summary);
  }, CRASH_CHECK_MS);
}

async function main() {
  const missing = missingFeature();
  if (missing) {
    fail(missing);
    return;
  }
  try {
    const [bundle, wasm] = await Promise.all([import(BUNDLE), download(WASM)]);
    await bundle.default({ module_or_path: wasm });
    text.textContent = "Starting …";
    await bundle.start(CANVAS_ID);
    window.__robopheus = { inspect: () => JSON.parse(bundle.inspect()) };
    watchForCrash(bundle);
    loading.hidden = true;
    document.getElementById(CANVAS_ID).focus();
  } catch (error) {
    fail("The dashboard could not be loaded. Check the connection to the server and reload.", String(error?.message ?? error));
  }
}

main();
