//! Typed calls to a Robopheus service.
//!
//! [`Client`] speaks the wire vocabulary of `api` and nothing else; the program `robopheus` adds the
//! twin natively, so that an experiment can be checked on one's own machine before it is sent.

mod download;
mod error;
mod service;

pub use download::{Download, DownloadProgress};
pub use error::ClientError;
pub use service::{Client, Submission};

/// Installs the TLS provider of this process. Call once, before the first [`Client::new`].
pub fn install_tls() {
    // A second call finds the provider already installed, which is what we want.
    let _ = rustls::crypto::ring::default_provider().install_default();
}
