//! Policy: what becomes of a rehearsal, and how long to wait. No clock, no database, no randomness of its own.

use api::experiment::DigestClaim;
use api::run::{Fault, Whose};
use api::verdict::Verdict;
use std::time::Duration;

/// Shortest and longest time between two tries of a job.
pub const RETRY_SHORTEST: Duration = Duration::from_secs(1);
pub const RETRY_LONGEST: Duration = Duration::from_secs(600);
/// Longest pause while the database is away, so that work goes on within 10 s of its return.
pub const OUTAGE_LONGEST: Duration = Duration::from_secs(4);
const OUTAGE_SHORTEST: Duration = Duration::from_millis(200);
/// Problems quoted in a message; the rest is counted.
const PROBLEMS_QUOTED: usize = 3;

/// Where a rehearsed run goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Decision {
    Queue,
    Reject(Fault),
}

/// Compares the twin's verdict with the submitter's claim. Different digests mean that a twin is broken or old,
/// whatever the verdict says, so they come first.
pub fn after_rehearsal(verdict: &Verdict, claim: Option<&DigestClaim>) -> Decision {
    if let Some(claim) = claim.filter(|claim| claim.digest != verdict.digest) {
        return Decision::Reject(digest_mismatch(verdict, claim));
    }
    if verdict.accepted {
        return Decision::Queue;
    }
    Decision::Reject(Fault {
        whose: Whose::User,
        code: "rejected_by_twin".to_owned(),
        message: verdict.sentence.clone(),
    })
}

fn digest_mismatch(verdict: &Verdict, claim: &DigestClaim) -> Fault {
    let advice = if claim.twin_version == verdict.twin_version {
        "A robot's model may have changed meanwhile: let the twin run again and submit; if it happens twice, please report it."
    } else {
        "The versions differ: reload the page or update the program, then submit again."
    };
    Fault {
        whose: Whose::Platform,
        code: "digest_mismatch".to_owned(),
        message: format!(
            "The {} computed {} with {}, the service computed {} with {}. {advice}",
            claim.engine, claim.digest, claim.twin_version, verdict.digest, verdict.twin_version
        ),
    }
}

/// Fault of an experiment that the twin cannot even start.
pub fn invalid_experiment<'a>(problems: impl ExactSizeIterator<Item = (&'a str, &'a str)>) -> Fault {
    let count = problems.len();
    let mut quoted: Vec<String> = problems
        .take(PROBLEMS_QUOTED)
        .map(|(field, message)| format!("{field}: {message}"))
        .collect();
    if count > PROBLEMS_QUOTED {
        quoted.push(format!("and {} more", count - PROBLEMS_QUOTED));
    }
    Fault {
        whose: Whose::User,
        code: "invalid_experiment".to_owned(),
        message: quoted.join("; "),
    }
}

/// Time until the next try of a job: full jitter below a doubling ceiling, never outside
/// [`RETRY_SHORTEST`]..=[`RETRY_LONGEST`].
pub fn retry_pause(tries: u32, random: u64) -> Duration {
    jittered(tries, random, RETRY_SHORTEST, RETRY_LONGEST)
}

/// Pause after a call failed because the database is away.
pub fn outage_pause(failures: u32, random: u64) -> Duration {
    jittered(failures, random, OUTAGE_SHORTEST, OUTAGE_LONGEST)
}

fn jittered(tries: u32, random: u64, shortest: Duration, longest: Duration) -> Duration {
    let ceiling = shortest
        .saturating_mul(2_u32.checked_pow(tries).unwrap_or(u32::MAX))
        .min(longest);
    let span_ms = (ceiling - shortest.min(ceiling)).as_millis() as u64;
    shortest + Duration::from_millis(random % (span_ms + 1))
}

/// Bits for jitter; not for secrets.
pub fn random() -> u64 {
    uuid::Uuid::now_v7().as_u64_pair().1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(accepted: bool, digest: &str) -> Verdict {
        Verdict {
            format: "robopheus.verdict/1".to_owned(),
            accepted,
            sentence: "Two robots collide at 3.2 s.".to_owned(),
            findings: Vec::new(),
            digest: digest.to_owned(),
            twin_version: "twin-2".to_owned(),
            ticks: 1,
            smallest_separation_m: None,
            smallest_wall_distance_m: 1.0,
            largest_path_error_m: None,
        }
    }

    fn claim(digest: &str, twin_version: &str) -> DigestClaim {
        DigestClaim {
            digest: digest.to_owned(),
            twin_version: twin_version.to_owned(),
            engine: "browser".to_owned(),
        }
    }

    #[test]
    fn equal_digests_leave_the_verdict_alone() {
        assert_eq!(
            after_rehearsal(&verdict(true, "aa"), Some(&claim("aa", "twin-2"))),
            Decision::Queue
        );
        assert_eq!(after_rehearsal(&verdict(true, "aa"), None), Decision::Queue);
        let Decision::Reject(fault) = after_rehearsal(&verdict(false, "aa"), None) else {
            panic!("a refused experiment was queued")
        };
        assert_eq!((fault.whose, fault.code.as_str()), (Whose::User, "rejected_by_twin"));
    }

    #[test]
    fn a_mismatch_names_both_versions_and_digests() {
        let Decision::Reject(fault) = after_rehearsal(&verdict(true, "aa"), Some(&claim("bb", "twin-1"))) else {
            panic!("queued")
        };
        assert_eq!((fault.whose, fault.code.as_str()), (Whose::Platform, "digest_mismatch"));
        for part in ["aa", "bb", "twin-1", "twin-2", "reload"] {
            assert!(fault.message.contains(part), "{part} is missing in: {}", fault.message);
        }
    }

    #[test]
    fn pauses_stay_in_their_range_for_any_number_of_tries() {
        let mut random = 1_u64;
        for tries in (0..100_000).chain([u32::MAX - 1, u32::MAX]) {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            assert!(
                (RETRY_SHORTEST..=RETRY_LONGEST).contains(&retry_pause(tries, random)),
                "tries {tries} random {random}"
            );
            assert!(outage_pause(tries, random) <= OUTAGE_LONGEST);
        }
    }

    #[test]
    fn many_problems_are_counted() {
        let problems = [("a", "x"), ("b", "x"), ("c", "x"), ("d", "x"), ("e", "x")];
        assert_eq!(
            invalid_experiment(problems.into_iter()).message,
            "a: x; b: x; c: x; and 2 more"
        );
    }
}
