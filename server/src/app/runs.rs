//! Looking at runs and stopping them.

use super::error::AppError;
use crate::access::{Principal, Role};
use api::run::RunView;
use store::{Cancelled, Store};
use uuid::Uuid;

/// A run, if the caller may see it. Somebody else's run does not exist for a user.
pub async fn get(store: &Store, principal: &Principal, id: Uuid) -> Result<RunView, AppError> {
    let run = store
        .run_get(id)
        .await?
        .filter(|run| principal.may_see_what_belongs_to(&run.submitted_by));
    run.ok_or_else(|| AppError::not_found("run", id))
}

/// Newest first.
pub async fn list(store: &Store, principal: &Principal, limit: i64) -> Result<Vec<RunView>, AppError> {
    Ok(store.run_list(limit, owner_filter(principal)).await?)
}

/// Ends a run at once, or asks the laboratory to stop it. Asking twice is harmless.
pub async fn cancel(store: &Store, principal: &Principal, id: Uuid) -> Result<RunView, AppError> {
    get(store, principal, id).await?;
    match store.run_cancel(id, &principal.name).await? {
        Cancelled::AtOnce | Cancelled::Requested => get(store, principal, id).await,
        Cancelled::Ended(state) => Err(AppError::Conflict {
            code: "run_ended",
            detail: format!("the run has ended as `{}` and cannot be cancelled", state.as_str()),
        }),
        Cancelled::Unknown => Err(AppError::not_found("run", id)),
    }
}

/// Whose things a list shows: everything for operators, their own for users.
pub fn owner_filter(principal: &Principal) -> Option<&str> {
    (!principal.is(Role::Operator)).then_some(principal.name.as_str())
}
