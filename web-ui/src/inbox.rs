//! Where the browser's callbacks leave what arrived, until the next frame takes it.

use crate::command::Event;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// Events waiting at most; when full, the oldest live frame goes first.
const WAITING_MAX: usize = 2_000;

#[derive(Clone)]
pub struct Inbox {
    events: Rc<RefCell<VecDeque<Event>>>,
    context: egui::Context,
}

impl Inbox {
    pub fn new(context: egui::Context) -> Self {
        Self {
            events: Rc::default(),
            context,
        }
    }

    /// Adds an event and wakes the dashboard.
    pub fn push(&self, event: Event) {
        let mut events = self.events.borrow_mut();
        if events.len() >= WAITING_MAX {
            let victim = events
                .iter()
                .position(|e| matches!(e, Event::LiveFrame { .. }))
                .unwrap_or(0);
            events.remove(victim);
        }
        events.push_back(event);
        drop(events);
        self.context.request_repaint();
    }

    /// Everything that arrived since the last call, oldest first.
    pub fn take(&self) -> VecDeque<Event> {
        std::mem::take(&mut *self.events.borrow_mut())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Request;
    use uuid::Uuid;

    #[test]
    fn a_full_inbox_keeps_answers_and_the_newest_frames() {
        let inbox = Inbox::new(egui::Context::default());
        inbox.push(Event::Answer {
            request: Request::Runs,
            answer: Err("first".to_owned()),
        });
        for n in 0..WAITING_MAX + 10 {
            inbox.push(Event::LiveFrame {
                run: Uuid::nil(),
                text: n.to_string(),
            });
        }
        let events = inbox.take();
        assert_eq!(events.len(), WAITING_MAX);
        assert!(matches!(events.front(), Some(Event::Answer { .. })));
        assert_eq!(
            events.back(),
            Some(&Event::LiveFrame {
                run: Uuid::nil(),
                text: (WAITING_MAX + 9).to_string()
            })
        );
        assert!(inbox.take().is_empty());
    }
}
