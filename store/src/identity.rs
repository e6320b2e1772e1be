//! Users and tokens.

use crate::connect::Store;
use crate::error::Result;
use crate::outcome::{Principal, Role};
use sha2::{Digest, Sha256};
use sqlx::PgExecutor;
use uuid::Uuid;

/// Characters of a token that are kept readable.
const PREFIX_LENGTH: usize = 10;

impl Store {
    /// Makes the user when unknown.
    pub async fn user_ensure(&self, name: &str) -> Result<()> {
        user_id(&mut *self.pool.acquire().await?, name).await?;
        Ok(())
    }

    /// Makes a token; the plain text is returned here and nowhere else.
    pub async fn token_create(&self, role: Role, user: &str) -> Result<String> {
        // Two version 4 ids: 244 bits from the operating system.
        let plain = format!("rph_{}{}", Uuid::new_v4().simple(), Uuid::new_v4().simple());
        let mut transaction = self.pool.begin().await?;
        let user_id = user_id(&mut transaction, user).await?;
        sqlx::query("INSERT INTO tokens (user_id, role, prefix, sha256) VALUES ($1, $2, $3, $4)")
            .bind(user_id)
            .bind(role.as_str())
            .bind(&plain[..PREFIX_LENGTH])
            .bind(sha256(&plain))
            .execute(&mut *transaction)
            .await?;
        transaction.commit().await?;
        Ok(plain)
    }

    /// Owner of a token that was not revoked.
    pub async fn token_lookup(&self, plain: &str) -> Result<Option<Principal>> {
        let row: Option<(String, String)> = sqlx::query_as(
            "SELECT u.name, t.role FROM tokens t JOIN users u ON u.id = t.user_id WHERE t.sha256 = $1 AND t.revoked_at IS NULL",
        )
        .bind(sha256(plain))
        .fetch_optional(&self.pool)
        .await?;
        Ok(row.and_then(|(user, role)| {
            Some(Principal {
                user,
                role: Role::from_name(&role)?,
            })
        }))
    }

    /// Ends a token; false when there was no such live token.
    pub async fn token_revoke(&self, plain: &str) -> Result<bool> {
        let done =
            sqlx::query("UPDATE tokens SET revoked_at = clock_timestamp() WHERE sha256 = $1 AND revoked_at IS NULL")
                .bind(sha256(plain))
                .execute(&self.pool)
                .await?;
        Ok(done.rows_affected() == 1)
    }
}

fn sha256(plain: &str) -> Vec<u8> {
    Sha256::digest(plain.as_bytes()).to_vec()
}

/// Id of a user, made when unknown.
pub(crate) async fn user_id(connection: &mut sqlx::PgConnection, name: &str) -> Result<Uuid> {
    insert_user(&mut *connection, name).await?;
    Ok(sqlx::query_scalar("SELECT id FROM users WHERE name = $1")
        .bind(name)
        .fetch_one(connection)
        .await?)
}

async fn insert_user(executor: impl PgExecutor<'_>, name: &str) -> Result<()> {
    sqlx::query("INSERT INTO users (name) SELECT $1 WHERE NOT EXISTS (SELECT FROM users WHERE name = $1) ON CONFLICT (name) DO NOTHING")
        .bind(name)
        .execute(executor)
        .await?;
    Ok(())
}
