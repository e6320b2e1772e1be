//! Tokens are kept as hashes and looked up whole.

use crate::fixture::*;
use store::*;

#[tokio::test]
async fn a_token_names_its_owner_until_revoked() {
    let world = world().await;
    for role in Role::ALL {
        let plain = world.store.token_create(role, "ada").await.unwrap();
        assert_eq!(
            world.store.token_lookup(&plain).await.unwrap(),
            Some(Principal {
                user: "ada".to_owned(),
                role
            })
        );
        assert_eq!(world.store.token_lookup(&plain[..plain.len() - 1]).await.unwrap(), None);
        let kept: i64 = world
            .database
            .scalar(&format!("SELECT count(*) FROM tokens WHERE prefix = '{plain}'"))
            .await;
        assert_eq!((plain.len(), kept), (68, 0), "the plain token is not kept");
        assert!(world.store.token_revoke(&plain).await.unwrap());
        assert!(!world.store.token_revoke(&plain).await.unwrap());
        assert_eq!(world.store.token_lookup(&plain).await.unwrap(), None);
    }
    world.store.user_ensure("ada").await.unwrap();
    assert_eq!(world.database.scalar::<i64>("SELECT count(*) FROM users").await, 1);
}

#[tokio::test]
async fn several_processes_may_migrate_at_once() {
    let world = world().await;
    let mut tasks = tokio::task::JoinSet::new();
    for _ in 0..4 {
        let store = world.store.clone();
        tasks.spawn(async move { store.migrate().await.unwrap() });
    }
    tasks.join_all().await;
}
