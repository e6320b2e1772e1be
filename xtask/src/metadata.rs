//! What `cargo metadata` says about the workspace and its dependencies.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::run;

#[derive(Deserialize)]
struct Document {
    packages: Vec<PackageRow>,
    workspace_members: Vec<String>,
    resolve: Option<ResolveRow>,
}

#[derive(Deserialize)]
struct PackageRow {
    id: String,
    name: String,
    manifest_path: PathBuf,
    dependencies: Vec<DependencyRow>,
    #[serde(default)]
    targets: Vec<TargetRow>,
}

#[derive(Deserialize)]
struct TargetRow {
    kind: Vec<String>,
}

impl PackageRow {
    /// It runs in the compiler: nothing of it is linked.
    fn is_macro(&self) -> bool {
        self.targets
            .iter()
            .any(|target| target.kind.iter().any(|kind| kind == "proc-macro"))
    }
}

#[derive(Deserialize)]
struct DependencyRow {
    name: String,
    kind: Option<String>,
}

#[derive(Deserialize)]
struct ResolveRow {
    nodes: Vec<NodeRow>,
}

#[derive(Deserialize)]
struct NodeRow {
    id: String,
    deps: Vec<NodeDependencyRow>,
}

#[derive(Deserialize)]
struct NodeDependencyRow {
    pkg: String,
    dep_kinds: Vec<KindRow>,
}

#[derive(Deserialize)]
struct KindRow {
    kind: Option<String>,
}

/// One package of the workspace.
#[derive(Clone, Debug, Default)]
pub struct Member {
    pub name: String,
    pub folder: PathBuf,
    /// Direct dependencies of the package itself and of its build script.
    pub direct: BTreeSet<String>,
    /// Direct dependencies of its tests only.
    pub for_tests: BTreeSet<String>,
    /// Every package it is linked with in the end (no build or test dependencies).
    pub linked: BTreeSet<String>,
}

/// Packages of the workspace by name, resolved for one target triple.
pub fn members(target: &str) -> Result<BTreeMap<String, Member>> {
    let text = run::read(&mut run::cargo([
        "metadata",
        "--format-version",
        "1",
        "--locked",
        "--filter-platform",
        target,
    ]))?;
    parse(&text)
}

fn parse(text: &str) -> Result<BTreeMap<String, Member>> {
    let document: Document = serde_json::from_str(text).context("output of cargo metadata")?;
    let names: BTreeMap<&str, &str> = document
        .packages
        .iter()
        .map(|row| (row.id.as_str(), row.name.as_str()))
        .collect();
    let macros: BTreeSet<&str> = document
        .packages
        .iter()
        .filter(|row| row.is_macro())
        .map(|row| row.id.as_str())
        .collect();
    let mut edges: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for node in document.resolve.iter().flat_map(|resolve| &resolve.nodes) {
        let linked = node
            .deps
            .iter()
            .filter(|dependency| dependency.dep_kinds.iter().any(|kind| kind.kind.is_none()))
            .filter(|dependency| !macros.contains(dependency.pkg.as_str()));
        edges.insert(&node.id, linked.map(|dependency| dependency.pkg.as_str()).collect());
    }
    let rows = document
        .packages
        .iter()
        .filter(|row| document.workspace_members.contains(&row.id));
    Ok(rows
        .map(|row| (row.name.clone(), member(row, &names, &edges)))
        .collect())
}

fn member(row: &PackageRow, names: &BTreeMap<&str, &str>, edges: &BTreeMap<&str, Vec<&str>>) -> Member {
    let folder = row.manifest_path.parent().map(PathBuf::from).unwrap_or_default();
    let named = |dev: bool| {
        let rows = row
            .dependencies
            .iter()
            .filter(move |one| (one.kind.as_deref() == Some("dev")) == dev);
        rows.map(|one| one.name.clone()).collect()
    };
    let mut linked_ids: BTreeSet<&str> = BTreeSet::new();
    let mut open: Vec<&str> = vec![&row.id];
    while let Some(id) = open.pop() {
        for next in edges.get(id).into_iter().flatten() {
            if linked_ids.insert(next) {
                open.push(next);
            }
        }
    }
    let linked = linked_ids
        .iter()
        .filter_map(|id| names.get(id))
        .map(|name| (*name).to_owned())
        .collect();
    Member {
        name: row.name.clone(),
        folder,
        direct: named(false),
        for_tests: named(true),
        linked,
    }
}

/// Triple of the machine this program was built for; good enough for checks of the dependency graph.
pub const HOST_TRIPLE: &str = if cfg!(target_arch = "aarch64") {
    "aarch64-unknown-linux-gnu"
} else {
    "x86_64-unknown-linux-gnu"
};
/// Triple of the browser bundles.
pub const WASM_TRIPLE: &str = "wasm32-unknown-unknown";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linked_packages_follow_normal_edges_and_no_macros() {
        let text = r#"{"packages":[
            {"id":"a","name":"alpha","manifest_path":"/w/alpha/Cargo.toml","dependencies":[{"name":"beta","kind":null},{"name":"checker","kind":"dev"}]},
            {"id":"b","name":"beta","manifest_path":"/r/beta/Cargo.toml","dependencies":[]},
            {"id":"c","name":"checker","manifest_path":"/r/checker/Cargo.toml","dependencies":[]},
            {"id":"d","name":"deep","manifest_path":"/r/deep/Cargo.toml","dependencies":[]},
            {"id":"m","name":"derive","manifest_path":"/r/derive/Cargo.toml","dependencies":[],"targets":[{"kind":["proc-macro"]}]},
            {"id":"r","name":"random","manifest_path":"/r/random/Cargo.toml","dependencies":[],"targets":[{"kind":["lib"]}]}],
          "workspace_members":["a"],
          "resolve":{"nodes":[
            {"id":"a","deps":[{"pkg":"b","dep_kinds":[{"kind":null}]},{"pkg":"c","dep_kinds":[{"kind":"dev"}]}]},
            {"id":"b","deps":[{"pkg":"d","dep_kinds":[{"kind":null}]},{"pkg":"m","dep_kinds":[{"kind":null}]}]},
            {"id":"m","deps":[{"pkg":"r","dep_kinds":[{"kind":null}]}]},
            {"id":"c","deps":[]},{"id":"d","deps":[]},{"id":"r","deps":[]}]}}"#;
        let members = parse(text).unwrap();
        let alpha = &members["alpha"];
        assert_eq!(alpha.linked, ["beta", "deep"].map(String::from).into());
        assert_eq!(alpha.direct, ["beta"].map(String::from).into());
        assert_eq!(alpha.for_tests, ["checker"].map(String::from).into());
        assert_eq!(alpha.folder, PathBuf::from("/w/alpha"));
    }
}
