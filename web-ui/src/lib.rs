//! The dashboard in the browser.
//!
//! `state` is plain data, `command` names everything that can happen, `update` is the only code that changes state,
//! `pages/<page>/{data,ui}` say what is shown and how, `theme` owns colours, sizes and formats. `platform`, `net` and
//! `worker` carry effects out in the browser; natively the crate compiles without them, for tests.
//!
//! # Test hook
//! `window.__robopheus.inspect()` returns `{frame, page, widgets, state}` of the newest frame; `frame` counts them, `widgets`
//! maps a name to `{x, y, w, h, enabled}` in CSS pixels. Only what is on the screen now is listed. Names:
//!
//! * everywhere: `nav.compose`, `nav.queue`, `nav.live`, `nav.run`, `nav.robots`, `nav.gap`, `nav.models`, `nav.theme`, `toast.<n>.close`
//! * Compose: `compose.template.rectangle-omni4`, `compose.template.rectangle-diff2`, `compose.template.paper-path`, `compose.template.swap-corners`, `compose.template.own-controller`,
//!   `compose.step.a`, `compose.step.c`, `compose.path` (opens the list of robots), `compose.path.<robot>`,
//!   `compose.mode.<title>`, `compose.correction.<title>`, `compose.horizon`, `compose.correction.models`,
//!   `compose.team` (opens the list), `compose.take.<robot>` (joins or leaves), `compose.label`, `compose.duration`, `compose.seed`, `compose.parameter.<key>`, `compose.parameters.reset`,
//!   `compose.json` (opens the document), `compose.json.copy`, `compose.arena` (the floor),
//!   `compose.robot.<i>` (start pose, drag), `compose.robot.<i>.yaw` (handle), `compose.target.<i>` (drag),
//!   `compose.laws` (opens the list), `compose.law.<name>`, `compose.controller` (opens the editor), `compose.side.settings`,
//!   `compose.side.program`, `compose.editor`, `compose.mistake` (leads to its line), `compose.words`, `compose.word.<i>`,
//!   `compose.examples` (opens the list), `compose.example.<name>`, `compose.example.yes`, `compose.example.no`,
//!   `compose.module.upload`, `compose.module.back`, `compose.module`, `compose.number.<name>`, `compose.number.<name>.remove`,
//!   `compose.number.name`, `compose.number.add`, `compose.log`,
//!   `compose.models`, `compose.play`, `compose.seek`, `compose.speed`, `compose.finding.<i>`, `compose.problem.<i>`, `compose.submit`
//! * Queue: `queue.row.<run id>` (opens), `queue.cancel.<run id>`, `queue.cancel.yes`, `queue.cancel.no`, `queue.compose`
//! * Live: `live.arena`, `live.log`, `live.open`, `live.compose`
//! * Run: `run.arena`, `run.log`, `run.plot`, `run.play`, `run.seek`, `run.speed`, `run.live`, `run.cancel`, `run.finding.<i>`,
//!   `run.tracking` (the sentence about the path), `run.side.motion`, `run.side.comparison`, `run.peer.<run id>` (opens), `run.comparison.floor`,
//!   `run.comparison.plot`, `run.comparison.models`,
//!   `run.download.archive`, `run.download.<file name>`
//! * Robots: `robots.row.<name>`
//! * Gap: `gap.robot.<name>`, `gap.run.<run id>.same`, `gap.run.<run id>.changed`, `gap.run.<run id>.locked`, `gap.keep`, `gap.start`, `gap.new`,
//!   `gap.row.<diagnosis id>`, `gap.cancel`, `gap.accept`, `gap.revert`, `gap.back`, `gap.drift`, `gap.follow`, `gap.next`, `gap.next.run`, `gap.page`,
//!   `gap.floor`, `gap.elsewhere`
//! * Models: `models.robot.<name>`, `models.row.<version>` (`models.row.Nominal twin`), `models.use`, `models.download.json`, `models.download.onnx`,
//!   `models.other.<version>`, `models.run.<run id>`, `models.compare`, `models.result`, `models.refusal`, `models.drift`, `models.elsewhere`

#[cfg(target_arch = "wasm32")]
pub mod app;
pub mod arena_view;
pub mod command;
pub mod correction;
pub mod course;
pub mod error_measure;
#[cfg(target_arch = "wasm32")]
mod file_dialogue;
pub mod inbox;
pub mod inspect;
pub mod net;
pub mod output;
pub mod pages;
pub mod paper_path;
pub mod parameters;
#[cfg(target_arch = "wasm32")]
pub mod platform;
pub mod report;
pub mod scenario;
pub mod state;
pub mod theme;
pub mod tracking;
pub mod update;
pub mod worker;

#[cfg(target_arch = "wasm32")]
mod shell;
