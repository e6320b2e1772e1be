//! The user a database server runs as when a root process starts it.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use anyhow::{Context, Result, bail};

/// A user of this machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct User {
    pub uid: u32,
    pub gid: u32,
}

/// `postgres` when the machine has it, else `nobody`.
pub fn unprivileged() -> Result<User> {
    let text = fs::read_to_string("/etc/passwd").context("read /etc/passwd")?;
    let found = ["postgres", "nobody"].into_iter().find_map(|name| user_in(&text, name));
    match found {
        Some(user) => Ok(user),
        None => bail!("PostgreSQL refuses to run as root and this machine has neither a user `postgres` nor `nobody`"),
    }
}

/// Entry of a user in the text of /etc/passwd; never root.
fn user_in(passwd: &str, name: &str) -> Option<User> {
    let mut rows = passwd.lines().map(|line| line.split(':').collect::<Vec<_>>());
    let row = rows.find(|fields| fields.first() == Some(&name))?;
    let user = User {
        uid: row.get(2)?.parse().ok()?,
        gid: row.get(3)?.parse().ok()?,
    };
    (user.uid != 0).then_some(user)
}

/// True when the user may pass through every folder from `/` down to this one.
pub fn may_enter(user: User, folder: &Path) -> bool {
    folder.ancestors().filter(|at| !at.as_os_str().is_empty()).all(|at| {
        at.metadata().is_ok_and(|meta| {
            let shift = if meta.uid() == user.uid {
                6
            } else if meta.gid() == user.gid {
                3
            } else {
                0
            };
            (meta.mode() >> shift) & 0o1 == 0o1
        })
    })
}

/// Empties a folder without removing it, so that its owner and permissions stay.
pub fn remove_contents(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).with_context(|| format!("read {}", folder.display()))? {
        let path = entry?.path();
        let removed = if path.is_dir() && !path.is_symlink() {
            fs::remove_dir_all(&path)
        } else {
            fs::remove_file(&path)
        };
        removed.with_context(|| format!("remove {}", path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PASSWD: &str =
        "root:x:0:0:root:/root:/bin/bash\nnobody:x:65534:65534::/:/bin/false\npostgres:x:101:104::/var:/bin/sh\n";

    #[test]
    fn users_are_found_and_root_is_never_one() {
        assert_eq!(user_in(PASSWD, "postgres"), Some(User { uid: 101, gid: 104 }));
        assert_eq!(user_in(PASSWD, "root"), None);
        assert_eq!(user_in(PASSWD, "post"), None);
    }

    #[test]
    fn a_folder_under_a_closed_one_cannot_be_entered() {
        use std::os::unix::fs::PermissionsExt;
        let closed = std::env::temp_dir().join(format!("xtask-closed-{}", std::process::id()));
        let inside = closed.join("inside");
        fs::create_dir_all(&inside).unwrap();
        fs::set_permissions(&closed, fs::Permissions::from_mode(0o700)).unwrap();
        let stranger = User {
            uid: 64_321,
            gid: 64_321,
        };
        assert!(!may_enter(stranger, &inside));
        fs::set_permissions(&closed, fs::Permissions::from_mode(0o711)).unwrap();
        assert!(may_enter(stranger, &inside));
        fs::remove_dir_all(&closed).unwrap();
    }
}
