//! The way to the service: which address belongs to which request. The browser part is in `http` and `socket`.

#[cfg(target_arch = "wasm32")]
pub mod http;
#[cfg(target_arch = "wasm32")]
pub mod socket;

use crate::command::Request;
use crate::update::{REPLAY_FILE, TRACK_FILE};
use api::BASE_PATH;
use uuid::Uuid;

/// Method and path of a request.
pub fn route(request: &Request) -> (&'static str, String) {
    match request {
        Request::Arenas => ("GET", format!("{BASE_PATH}/arenas")),
        Request::Robots => ("GET", format!("{BASE_PATH}/robots")),
        Request::Runs => ("GET", format!("{BASE_PATH}/runs")),
        Request::Run(id) => ("GET", format!("{BASE_PATH}/runs/{id}")),
        Request::Cancel(id) => ("POST", format!("{BASE_PATH}/runs/{id}/cancel")),
        Request::Replay(id) => ("GET", file_url(*id, REPLAY_FILE)),
        Request::Track(id) => ("GET", file_url(*id, TRACK_FILE)),
        Request::Submit => ("POST", format!("{BASE_PATH}/experiments")),
        Request::Models => ("GET", format!("{BASE_PATH}/models?current=true")),
        Request::Gaps(robot) => ("GET", format!("{BASE_PATH}/robots/{}/gaps", escaped(robot))),
        Request::RobotModel(robot) => ("GET", format!("{BASE_PATH}/robots/{}/model", escaped(robot))),
        Request::Diagnoses => ("GET", format!("{BASE_PATH}/diagnoses")),
        Request::Report(id) => ("GET", format!("{BASE_PATH}/diagnoses/{id}/report.json")),
        Request::StartDiagnosis => ("POST", format!("{BASE_PATH}/diagnoses")),
        Request::Diagnosis(id, verb) => ("POST", format!("{BASE_PATH}/diagnoses/{id}/{verb}")),
        Request::ChooseModel(robot) => ("PUT", format!("{BASE_PATH}/robots/{}/model", escaped(robot))),
        Request::Versions(robot) => ("GET", format!("{BASE_PATH}/models?robot={}", escaped(robot))),
        // Not through the service: it works while that does not.
        Request::Stop(page) => ("POST", format!("{page}stop")),
        Request::Compare => ("POST", format!("{BASE_PATH}/models/compare")),
        Request::KeepReferences(robot) => ("PUT", format!("{BASE_PATH}/robots/{}/references", escaped(robot))),
    }
}

/// A name as it may stand in an address.
fn escaped(name: &str) -> String {
    name.bytes().fold(String::new(), |mut text, byte| {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            text.push(char::from(byte));
        } else {
            text.push_str(&format!("%{byte:02X}"));
        }
        text
    })
}

/// Address of a version's document, and of its network.
pub fn model_url(model: Uuid) -> String {
    format!("{BASE_PATH}/models/{model}/model.json")
}

pub fn network_url(model: Uuid) -> String {
    format!("{BASE_PATH}/models/{model}/onnx")
}

/// Address of a diagnosis' report as a page.
pub fn report_page_url(diagnosis: Uuid) -> String {
    format!("{BASE_PATH}/diagnoses/{diagnosis}/report.html")
}

/// Address of one file of a run.
pub fn file_url(run: Uuid, name: &str) -> String {
    format!("{BASE_PATH}/runs/{run}/files/{name}")
}

/// Address of the zip of everything.
pub fn archive_url(run: Uuid) -> String {
    format!("{BASE_PATH}/runs/{run}/archive")
}

/// Path of the live connection.
pub fn live_path(run: Uuid) -> String {
    format!("{BASE_PATH}/runs/{run}/live")
}
