//! First-start tokens: `<data>/tokens/<role>`, readable by the owner only.

use crate::config::write_whole;
use crate::state::LOCAL_USER;
use anyhow::Context as _;
use std::path::Path;
use store::{Role, Store};

/// Makes every role's token that is missing or unknown to the database. People's tokens belong to the local user.
pub async fn ensure(store: &Store, folder: &Path) -> anyhow::Result<()> {
    store.user_ensure(LOCAL_USER).await.context("make the local user")?;
    for role in Role::ALL {
        let path = folder.join(role.as_str());
        if is_known(store, &path, role).await? {
            continue;
        }
        let user = match role {
            Role::User | Role::Operator => LOCAL_USER,
            Role::Lab | Role::Scheduler => role.as_str(),
        };
        store.user_ensure(user).await.context("make a user for a token")?;
        let token = store.token_create(role, user).await.context("make a token")?;
        write_whole(&path, &format!("{token}\n"), 0o600).with_context(|| format!("write {}", path.display()))?;
        tracing::info!(role = role.as_str(), file = %path.display(), "token made");
    }
    Ok(())
}

async fn is_known(store: &Store, path: &Path, role: Role) -> anyhow::Result<bool> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        Err(error) => return Err(error).with_context(|| format!("read {}", path.display())),
    };
    let found = store.token_lookup(text.trim()).await.context("look a token up")?;
    Ok(found.is_some_and(|principal| principal.role == role))
}
