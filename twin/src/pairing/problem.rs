//! Why a pair is refused.

use serde::Serialize;

use super::Pairing;
use super::budget::{BUDGETS, Budget, Item, items};
use super::controller::{CONTROLLERS, Controller};
use super::sensor::SensorKind;

/// Consumers that a message names.
const NAMED_CONSUMERS: usize = 4;

/// One budget that does not suffice.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[error(
    "{field}: {subject} needs {needed} {unit}{parts} (limit: {available} on {controller}; {remedy})",
    unit = budget.unit(),
    parts = named(consumers, *needed)
)]
pub struct PairingProblem {
    /// Path in the robot document: `sensors[5]` if one sensor is too much by itself, else `controller` or
    /// `robot.wheels`.
    pub field: String,
    pub budget: Budget,
    /// The sensor, or `the robot`.
    pub subject: String,
    pub needed: u64,
    pub available: u64,
    /// Name of the controller that has the budget.
    pub controller: &'static str,
    /// Who needs it, the largest first.
    pub consumers: Vec<Consumer>,
    /// What to do about it.
    pub remedy: String,
}

/// Part of a need.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Consumer {
    pub name: String,
    pub needed: u64,
}

fn named(consumers: &[Consumer], needed: u64) -> String {
    if consumers.len() < 2 {
        return String::new();
    }
    let shown = &consumers[..consumers.len().min(NAMED_CONSUMERS)];
    let mut parts: Vec<String> = shown
        .iter()
        .map(|consumer| format!("{} {}", consumer.name, consumer.needed))
        .collect();
    let rest = shown
        .iter()
        .fold(needed, |rest, consumer| rest.saturating_sub(consumer.needed));
    if rest > 0 {
        parts.push(format!("others {rest}"));
    }
    format!(" [{}]", parts.join(", "))
}

/// All budgets that do not suffice; empty if the pair works.
///
/// A sensor that is too much by itself is a problem of its own; what remains is counted together.
pub(super) fn problems(pair: &Pairing) -> Vec<PairingProblem> {
    let controller = pair.controller.controller();
    let items = items(pair, controller);
    let mut problems = Vec::new();
    for budget in BUDGETS {
        let available = budget.available(controller);
        let (alone, rest): (Vec<&Item>, Vec<&Item>) = items
            .iter()
            .partition(|item| item.sensor.is_some() && item.need(budget) > available);
        for item in alone {
            problems.push(problem(pair, budget, &[item], item.field.clone(), &item.name));
        }
        if budget.total(rest.iter().copied()) > available {
            let field = match budget {
                Budget::ConnectorPins => "robot.wheels",
                _ => "controller",
            };
            problems.push(problem(pair, budget, &rest, field.to_owned(), "the robot"));
        }
    }
    problems
}

fn problem(pair: &Pairing, budget: Budget, items: &[&Item], field: String, subject: &str) -> PairingProblem {
    let controller = pair.controller.controller();
    let mut consumers: Vec<Consumer> = items
        .iter()
        .filter(|item| item.need(budget) > 0)
        .map(|item| Consumer {
            name: item.name.clone(),
            needed: item.need(budget),
        })
        .collect();
    // Stable: equal needs stay in the order of the document.
    consumers.sort_by_key(|consumer| core::cmp::Reverse(consumer.needed));
    PairingProblem {
        field,
        budget,
        subject: subject.to_owned(),
        needed: budget.total(items.iter().copied()),
        available: budget.available(controller),
        controller: controller.kind.name(),
        remedy: remedy(pair, budget, items),
        consumers,
    }
}

/// Only what helps: controllers that can serve the whole pair, or a sensor without which this budget suffices.
fn remedy(pair: &Pairing, budget: Budget, items: &[&Item]) -> String {
    if budget == Budget::ConnectorPins {
        return "drive fewer wheels: a motor takes 7 pins, a steering gear 3".to_owned();
    }
    let others: Vec<&str> = CONTROLLERS
        .iter()
        .filter(|other| suffices(pair, other))
        .map(|other| other.kind.name())
        .collect();
    let mut options = Vec::new();
    if !others.is_empty() {
        options.push(format!("use {}", others.join(" or ")));
    }
    options.push(match dispensable(pair, budget, items) {
        Some(sensor) => format!("leave out {sensor}"),
        None => "drive fewer wheels".to_owned(),
    });
    options.join(", or ")
}

/// The last sensor of the document without which `items` fit; never the encoders, which the speed loops need.
fn dispensable(pair: &Pairing, budget: Budget, items: &[&Item]) -> Option<&'static str> {
    let available = budget.available(pair.controller.controller());
    let fits_without = |left_out: &Item| {
        let rest = items.iter().copied().filter(|item| !core::ptr::eq(*item, left_out));
        budget.total(rest) <= available
    };
    let mut candidates = items.iter().rev().filter(|item| fits_without(item));
    candidates.find_map(|item| {
        item.sensor
            .filter(|sensor| *sensor != SensorKind::Encoder)
            .map(SensorKind::name)
    })
}

/// No budget of `controller` is exceeded by this chassis with these sensors.
fn suffices(pair: &Pairing, controller: &Controller) -> bool {
    let items = items(pair, controller);
    BUDGETS
        .iter()
        .all(|budget| budget.total(items.iter()) <= budget.available(controller))
}
