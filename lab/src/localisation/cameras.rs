//! One thread for each camera's process; all of them feed one fusion.

use super::{Localisation, line};
use crate::camera::refusals::RefusalLine;
use crate::camera::sighting::Sighting;
use crate::clock::monotonic_us;
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, PoisonError};

/// Reads one camera's process until this process ends.
pub(super) fn start(localisation: Arc<Localisation>, camera: u16, socket: PathBuf) -> io::Result<()> {
    std::thread::Builder::new()
        .name(format!("camera-{camera}"))
        .spawn(move || {
            line::read_for_ever(&format!("camera {camera}"), &socket, |bytes| {
                let sighting: Sighting = match serde_json::from_slice(bytes) {
                    Ok(sighting) => sighting,
                    Err(error) => {
                        let Ok(line) = serde_json::from_slice::<RefusalLine>(bytes) else {
                            return Err(error.into());
                        };
                        if let Some(fuser) = &localisation.fuser {
                            let mut fuser = fuser.lock().unwrap_or_else(PoisonError::into_inner);
                            fuser.note_refusals(camera, &line);
                        }
                        return Ok(());
                    }
                };
                let frame = localisation.fuser.as_ref().and_then(|fuser| {
                    let mut fuser = fuser.lock().unwrap_or_else(PoisonError::into_inner);
                    fuser.take(camera, &sighting, monotonic_us())
                });
                if let Some(frame) = frame {
                    localisation.take(frame);
                }
                Ok(())
            });
        })?;
    Ok(())
}
