// Module worker: the twin off the page's thread.
//
// in   {kind:"start", id, scenario}      scenario: object or JSON text {experiment, robots, arena}
//      {kind:"cancel", id}
// out  {kind:"progress", id, fraction, frames:[{tick, time_s, robots:[{pose, target, safety}]}]}
//      {kind:"done", id, verdict, replay, digest, twin_version}
//      {kind:"problems", id, problems}   the scenario was refused
//      {kind:"error", id, message}       the simulation could not be loaded or broke
//
// One simulation at a time: a new start ends the one before it without a further message about it. Work is done in
// pieces of about PIECE_MS; between two pieces waiting messages are handled.

const PIECE_MS = 25;
const FIRST_TICKS = 60;
const LEAST_TICKS = 4; // one frame
const MOST_TICKS = 6000;

let running = null; // {id, turn, simulation, twin_version}
let starts = 0;
let ticks = FIRST_TICKS; // ticks in a piece, fitted to PIECE_MS

const module = import("/bundle/sim_wasm.js").then(async (wasm) => {
  await wasm.default({ module_or_path: "/bundle/sim_wasm_bg.wasm" });
  return wasm;
});
module.catch(() => {}); // reported where it is awaited

// A message to oneself goes behind those that wait, without the delay of a timer.
const turn = new MessageChannel();
turn.port1.onmessage = ({ data }) => {
  if (running?.turn === data) piece();
};

self.onmessage = ({ data }) => {
  if (data?.kind === "start") {
    start(data.id, data.scenario);
  } else if (data?.kind === "cancel" && running?.id === data.id) {
    end();
  }
};

async function start(id, scenario) {
  end();
  starts += 1;
  const mine = { id, turn: starts, simulation: null, twin_version: "" };
  running = mine;
  try {
    const wasm = await module;
    if (running !== mine) return;
    const text = typeof scenario === "string" ? scenario : JSON.stringify(scenario);
    const problems = JSON.parse(wasm.check(text));
    if (problems.length > 0) {
      running = null;
      self.postMessage({ kind: "problems", id, problems });
      return;
    }
    mine.simulation = new wasm.Simulation(text);
    mine.twin_version = wasm.twin_version();
    turn.port2.postMessage(mine.turn);
  } catch (error) {
    fail(mine, error);
  }
}

function piece() {
  const mine = running;
  try {
    const begun = performance.now();
    const frames = JSON.parse(mine.simulation.advance(ticks));
    const used_ms = Math.max(performance.now() - begun, 0.1);
    ticks = Math.round(Math.min(MOST_TICKS, Math.max(LEAST_TICKS, (ticks * PIECE_MS) / used_ms)));
    self.postMessage({ kind: "progress", id: mine.id, fraction: mine.simulation.fraction(), frames });
    if (mine.simulation.finished()) {
      finish(mine);
    } else {
      turn.port2.postMessage(mine.turn);
    }
  } catch (error) {
    fail(mine, error);
  }
}

function finish(mine) {
  const { id, simulation, twin_version } = mine;
  const verdict = JSON.parse(simulation.verdict());
  const replay = JSON.parse(simulation.replay());
  const digest = simulation.digest();
  end();
  self.postMessage({ kind: "done", id, verdict, replay, digest, twin_version });
}

function fail(mine, error) {
  if (running === mine) running = null; // a broken instance is not freed
  self.postMessage({ kind: "error", id: mine.id, message: String(error?.message ?? error) });
}

function end() {
  running?.simulation?.free();
  running = null;
}
