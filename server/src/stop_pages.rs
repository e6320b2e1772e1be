//! The laboratories' protective stops: the dashboard calls them itself, so that its button works without this service.

use api::problem::FieldProblem;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use store::Store;

/// Longest wait for the database before the last known pages are taken.
const PATIENCE: Duration = Duration::from_secs(1);

/// Origins of the pages, as they were known last.
#[derive(Debug, Default)]
pub struct StopPages(Mutex<Vec<String>>);

impl StopPages {
    /// Origins that the dashboard may call, also while the database does not answer.
    pub async fn origins(&self, store: &Store) -> Vec<String> {
        if let Ok(Ok(urls)) = tokio::time::timeout(PATIENCE, store.stop_urls()).await {
            let mut origins: Vec<_> = urls.iter().filter_map(|url| origin(url)).map(str::to_owned).collect();
            origins.dedup();
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = origins;
        }
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Scheme, host and port of an address that ends with `/`; none of anything that could mean more to a browser.
fn origin(url: &str) -> Option<&str> {
    let origin = url.strip_suffix('/')?;
    let (_, authority) = origin
        .split_once("://")
        .filter(|(scheme, _)| ["http", "https"].contains(scheme))?;
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-.:[]".contains(&byte);
    (!authority.is_empty() && authority.len() <= 260 && authority.bytes().all(plain)).then_some(origin)
}

/// What is wrong with the address that a laboratory tells.
pub fn problem(url: &str) -> Option<FieldProblem> {
    origin(url).is_none().then(|| FieldProblem {
        field: "stop_url".to_owned(),
        message: format!("`{url}` is no address of a stop page"),
        limit: "`http://host:port/` or `https://host/`, without path, query or user".to_owned(),
        remedy: "correct `stop_url` in the laboratory's description, or leave it out".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_an_origin_and_a_slash() {
        assert_eq!(origin("http://127.0.0.1:8081/"), Some("http://127.0.0.1:8081"));
        assert_eq!(origin("https://stop.lab.example/"), Some("https://stop.lab.example"));
        assert_eq!(origin("http://[::1]:8081/"), Some("http://[::1]:8081"));
        for bad in [
            "",
            "http://",
            "http:///",
            "http://a",
            "http://a/b/",
            "http://u@a/",
            "http://a;script-src *//",
            "http://a 'unsafe-eval'/",
            "http://a,b/",
            "javascript://a/",
            "ws://a/",
            "*/",
            "http://*/",
            "http://a?x/",
            "http://a#x/",
            "http://\u{e4}/",
        ] {
            assert_eq!(origin(bad), None, "{bad}");
            let problem = problem(bad).expect("a problem");
            assert_eq!(problem.field, "stop_url");
        }
    }
}
