//! The protective stop's button.

use super::*;
use crate::command::HttpAnswer;
use api::arena::ArenaView;
use chrono::DateTime;

fn clock(time_s: f64) -> Clock {
    let utc = DateTime::from_timestamp_millis((1.7e12 + time_s * 1000.0) as i64);
    Clock {
        time_s,
        utc: utc.expect("in range"),
    }
}

fn with_pages(pages: &[Option<&str>]) -> State {
    let mut state = State::new(Uuid::from_u128(7 << 64), clock(0.0), false);
    let arenas = pages.iter().map(|page| ArenaView {
        arena: state.lab.reference.arena.clone(),
        state: "free".to_owned(),
        message: None,
        stopped: false,
        stop_url: page.map(str::to_owned),
    });
    state.lab.arenas = Some(arenas.collect());
    state
}

fn pressed(state: &mut State) -> Vec<String> {
    let effects = command(state, Command::StopRobots);
    let routes = effects.iter().map(|effect| match effect {
        Effect::Send {
            request, body: None, ..
        } => {
            let (method, address) = crate::net::route(request);
            format!("{method} {address}")
        }
        other => panic!("{other:?}"),
    });
    routes.collect()
}

#[test]
fn one_press_goes_to_every_laboratory_itself_and_to_each_once() {
    let (one, two) = ("http://127.0.0.1:8081/", "https://stop.example/");
    let mut state = with_pages(&[Some(one), None, Some(two), Some(one)]);
    assert_eq!(
        pressed(&mut state),
        ["POST http://127.0.0.1:8081/stop", "POST https://stop.example/stop"]
    );
    assert!(state.toasts.is_empty(), "nothing is claimed before an answer");
}

#[test]
fn without_a_known_stop_the_person_is_told_what_else_to_do() {
    let mut state = with_pages(&[None]);
    assert!(pressed(&mut state).is_empty());
    assert!(state.toasts[0].error && state.toasts[0].text.contains("button in the hall"));
}

#[test]
fn an_answer_of_the_laboratory_says_nothing_about_the_service() {
    let page = "http://127.0.0.1:8081/".to_owned();
    let mut state = with_pages(&[Some(&page)]);
    state.service.reachable = Some(false);
    pressed(&mut state);
    let request = Request::Stop(page.clone());
    let answer = Ok(HttpAnswer {
        status: 200,
        body: "{}".to_owned(),
    });
    event(&mut state, Event::Answer { request, answer });
    assert_eq!(state.service.reachable, Some(false));
    assert!(
        !state.toasts[0].error && state.toasts[0].text.contains("are stopped"),
        "{:?}",
        state.toasts
    );
    state.service.reachable = Some(true);
    let request = Request::Stop(page);
    let answer = Err("Failed to fetch".to_owned());
    event(&mut state, Event::Answer { request, answer });
    assert_eq!(state.service.reachable, Some(true));
    let toast = &state.toasts[1];
    assert!(toast.error && toast.text.contains("may still move"), "{toast:?}");
}

#[test]
fn a_pressed_stop_leads_to_the_page_that_clears_it() {
    let mut state = with_pages(&[Some("http://127.0.0.1:8081/")]);
    assert_eq!(state.lab.stopped(), None);
    if let Some(arenas) = &mut state.lab.arenas {
        arenas[0].stopped = true;
    }
    let page = state.lab.stopped().map(str::to_owned).expect("a page");
    let effects = command(&mut state, Command::OpenStopPage(page.clone()));
    assert_eq!(effects, [Effect::OpenBeside(page)]);
}
