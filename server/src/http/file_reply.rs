//! Answering with a file: Range, If-Range, ETag, HEAD.

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::io::SeekFrom;
use std::path::PathBuf;
use tokio::io::{AsyncReadExt as _, AsyncSeekExt as _};
use tokio_util::io::ReaderStream;

/// Bytes read from disk at a time.
const CHUNK_BYTES: usize = 64 * 1024;

/// A file and what to say about it.
#[derive(Debug, Clone)]
pub struct FileReply {
    pub path: PathBuf,
    pub media_type: String,
    /// Strong validator, without quotes.
    pub etag: String,
    /// Offered for saving under this name; shown in place when absent.
    pub save_as: Option<String>,
    pub cache_control: &'static str,
    /// `br` or `gzip` when the file is compressed already.
    pub encoding: Option<&'static str>,
}

/// What part of a file is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Whole,
    Part { first: u64, last: u64 },
    Unsatisfiable,
}

impl FileReply {
    pub async fn send(self, request: &HeaderMap) -> std::io::Result<Response> {
        let mut file = tokio::fs::File::open(&self.path).await?;
        let length = file.metadata().await?.len();
        let mut headers = self.headers();
        if matches_etag(request, header::IF_NONE_MATCH, &self.etag) {
            return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
        }
        let same_file = !request.contains_key(header::IF_RANGE) || matches_etag(request, header::IF_RANGE, &self.etag);
        let range = request
            .get(header::RANGE)
            .and_then(|value| value.to_str().ok())
            .filter(|_| same_file);
        match range.map_or(Wanted::Whole, |text| wanted(text, length)) {
            Wanted::Whole => {
                headers.insert(header::CONTENT_LENGTH, length.into());
                Ok((
                    headers,
                    Body::from_stream(ReaderStream::with_capacity(file, CHUNK_BYTES)),
                )
                    .into_response())
            }
            Wanted::Part { first, last } => {
                file.seek(SeekFrom::Start(first)).await?;
                let part = last - first + 1;
                headers.insert(header::CONTENT_LENGTH, part.into());
                insert(
                    &mut headers,
                    header::CONTENT_RANGE,
                    &format!("bytes {first}-{last}/{length}"),
                );
                let body = Body::from_stream(ReaderStream::with_capacity(file.take(part), CHUNK_BYTES));
                Ok((StatusCode::PARTIAL_CONTENT, headers, body).into_response())
            }
            Wanted::Unsatisfiable => {
                let mut headers = HeaderMap::new();
                insert(&mut headers, header::CONTENT_RANGE, &format!("bytes */{length}"));
                Ok((StatusCode::RANGE_NOT_SATISFIABLE, headers).into_response())
            }
        }
    }

    fn headers(&self) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(self.cache_control));
        insert(&mut headers, header::CONTENT_TYPE, &self.media_type);
        insert(&mut headers, header::ETAG, &format!("\"{}\"", self.etag));
        if let Some(name) = &self.save_as {
            let safe: String = name
                .chars()
                .map(|c| {
                    if c.is_ascii_alphanumeric() || "._-".contains(c) {
                        c
                    } else {
                        '_'
                    }
                })
                .collect();
            insert(
                &mut headers,
                header::CONTENT_DISPOSITION,
                &format!("attachment; filename=\"{safe}\""),
            );
        }
        if let Some(encoding) = self.encoding {
            headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static(encoding));
        }
        headers
    }
}

fn insert(headers: &mut HeaderMap, name: header::HeaderName, text: &str) {
    if let Ok(value) = HeaderValue::from_str(text) {
        headers.insert(name, value);
    }
}

fn matches_etag(request: &HeaderMap, name: header::HeaderName, etag: &str) -> bool {
    let text = request
        .get(&name)
        .and_then(|value| value.to_str().ok())
        .unwrap_or_default();
    let weak_is_enough = name == header::IF_NONE_MATCH;
    text.split(',').map(str::trim).any(|candidate| {
        let candidate = if weak_is_enough {
            candidate.trim_start_matches("W/")
        } else {
            candidate
        };
        (weak_is_enough && candidate == "*") || candidate.trim_matches('"') == etag
    })
}

/// One range of bytes; several ranges or nonsense mean the whole file, as RFC 9110 allows.
fn wanted(text: &str, length: u64) -> Wanted {
    let Some((first, last)) = text
        .trim()
        .strip_prefix("bytes=")
        .and_then(|range| range.trim().split_once('-'))
    else {
        return Wanted::Whole;
    };
    match (first.trim().parse::<u64>(), last.trim().parse::<u64>()) {
        (Ok(first), Ok(last)) if first <= last && first < length => Wanted::Part {
            first,
            last: last.min(length - 1),
        },
        (Ok(first), Ok(last)) if first > last => Wanted::Whole,
        (Ok(first), Err(_)) if last.trim().is_empty() && first < length => Wanted::Part {
            first,
            last: length - 1,
        },
        (Ok(_), Err(_)) if !last.trim().is_empty() => Wanted::Whole,
        (Ok(_), _) => Wanted::Unsatisfiable,
        (Err(_), Ok(0)) if first.trim().is_empty() => Wanted::Unsatisfiable,
        (Err(_), Ok(_)) if first.trim().is_empty() && length == 0 => Wanted::Unsatisfiable,
        (Err(_), Ok(tail)) if first.trim().is_empty() => Wanted::Part {
            first: length.saturating_sub(tail),
            last: length - 1,
        },
        _ => Wanted::Whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_follow_rfc_9110() {
        let cases = [
            ("bytes=0-0", Wanted::Part { first: 0, last: 0 }),
            ("bytes=2-", Wanted::Part { first: 2, last: 9 }),
            ("bytes=5-500", Wanted::Part { first: 5, last: 9 }),
            ("bytes=-3", Wanted::Part { first: 7, last: 9 }),
            ("bytes=-99", Wanted::Part { first: 0, last: 9 }),
            ("bytes=10-", Wanted::Unsatisfiable),
            ("bytes=10-12", Wanted::Unsatisfiable),
            ("bytes=-0", Wanted::Unsatisfiable),
            ("bytes=5-2", Wanted::Whole),
            ("bytes=0-1,4-5", Wanted::Whole),
            ("bytes=a-b", Wanted::Whole),
            ("bytes=-", Wanted::Whole),
            ("items=0-1", Wanted::Whole),
        ];
        for (text, expected) in cases {
            assert_eq!(wanted(text, 10), expected, "{text}");
        }
        assert_eq!(wanted("bytes=-3", 0), Wanted::Unsatisfiable);
        assert_eq!(wanted("bytes=0-", 0), Wanted::Unsatisfiable);
    }

    #[test]
    fn if_range_needs_the_strong_validator() {
        let mut headers = HeaderMap::new();
        headers.insert(header::IF_RANGE, HeaderValue::from_static("W/\"abc\""));
        assert!(!matches_etag(&headers, header::IF_RANGE, "abc"));
        headers.insert(header::IF_RANGE, HeaderValue::from_static("\"abc\""));
        assert!(matches_etag(&headers, header::IF_RANGE, "abc"));
    }
}
