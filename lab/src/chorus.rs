//! The orders of one tick for several robots on their way into groups: what stands in which frame, without socket and clock.

use crate::clock_map::link_clock_ms;
use crate::commander::CommandPart;
use robot::frame::{GROUP_MAX_ROBOTS, GroupHeader, MAX_CHARACTERS, Part, encode_group};

/// Whether a run's robots hear groups: there are several, all of them read groups, and their frames have one epoch.
///
/// - `robots`: epoch of each robot's frames, and whether it reads groups.
pub fn hears_groups(robots: impl IntoIterator<Item = (u32, bool)>) -> bool {
    let mut robots = robots.into_iter();
    let Some((epoch, true)) = robots.next() else {
        return false;
    };
    let mut several = false;
    robots.all(|(other, reads)| {
        several = true;
        reads && other == epoch
    }) && several
}

/// Characters of one group, and for whom it is.
#[derive(Debug, Clone)]
pub struct GroupFrame {
    characters: [u8; MAX_CHARACTERS],
    length: usize,
    robots: [u8; GROUP_MAX_ROBOTS],
    count: usize,
}

impl GroupFrame {
    fn new(header: &GroupHeader, parts: &[CommandPart]) -> Self {
        let mut frame = Self {
            characters: [0; MAX_CHARACTERS],
            length: 0,
            robots: [0; GROUP_MAX_ROBOTS],
            count: parts.len().min(GROUP_MAX_ROBOTS),
        };
        for (slot, part) in frame.robots.iter_mut().zip(parts) {
            *slot = part.robot();
        }
        let parts: Vec<Part> = parts.iter().map(|part| *part.part()).collect();
        frame.length = encode_group(header, &parts, &mut frame.characters);
        frame
    }

    /// The frame as it goes on the link.
    pub fn as_bytes(&self) -> &[u8] {
        self.characters.get(..self.length).unwrap_or_default()
    }

    /// Numbers of the robots in it, ascending.
    pub fn robots(&self) -> &[u8] {
        self.robots.get(..self.count).unwrap_or_default()
    }
}

/// See the module.
#[derive(Debug, Default)]
pub struct Chorus {
    /// Of this tick's groups; chosen with its first part.
    sequence: Option<u32>,
    parts: Vec<CommandPart>,
}

impl Chorus {
    /// - `robots`: most of them in one tick.
    pub fn with_room_for(robots: usize) -> Self {
        Self {
            sequence: None,
            parts: Vec::with_capacity(robots),
        }
    }

    /// Sequence of this tick's groups: new to every robot.
    ///
    /// - `next`: of each robot, asked for the first part of a tick only.
    pub fn sequence(&mut self, next: impl Iterator<Item = u32>) -> u32 {
        *self.sequence.get_or_insert_with(|| next.max().unwrap_or(1))
    }

    /// A robot's part of this tick; one for each robot.
    pub fn push(&mut self, part: CommandPart) {
        self.parts.push(part);
    }

    /// Hands this tick's groups over and is ready for the next tick.
    ///
    /// - `epoch`: of all robots' frames.
    pub fn finish(&mut self, epoch: u32, tick: u32, now_us: i64, mut send: impl FnMut(&GroupFrame)) {
        let Some(sequence) = self.sequence.take() else { return };
        self.parts.sort_unstable_by_key(CommandPart::robot);
        // Every robot is in one group, so all groups of a tick may have the same sequence.
        for parts in self.parts.chunks(GROUP_MAX_ROBOTS) {
            let header = GroupHeader {
                epoch,
                sequence,
                tick,
                clock_ms: link_clock_ms(now_us),
            };
            send(&GroupFrame::new(&header, parts));
        }
        self.parts.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commander::{Commander, Order, Still};
    use robot::frame::decode_for;
    use robot::key::Key;

    #[test]
    fn one_robot_and_robots_that_do_not_agree_hear_no_groups() {
        assert!(hears_groups([(3, true), (3, true)]));
        assert!(!hears_groups([]));
        assert!(!hears_groups([(3, true)]));
        assert!(!hears_groups([(3, true), (4, true)]));
        assert!(!hears_groups([(3, true), (3, true), (3, false)]));
        assert!(!hears_groups([(3, false), (3, true)]));
    }

    /// Twenty robots are two groups of one sequence; every robot finds its part in one of them, and none in the other.
    #[test]
    fn every_robot_is_in_one_group_with_a_sequence_that_is_new_to_it() {
        let key = Key::from_hex("000102030405060708090a0b0c0d0e0f").expect("a key");
        let mut robots: Vec<Commander> = (1..=20)
            .rev()
            .map(|number| Commander::new(number, key, vec![0, 1], 7, 10 + u32::from(number)))
            .collect();
        let mut chorus = Chorus::with_room_for(20);
        for tick in 0..3 {
            for place in 0..robots.len() {
                let sequence = chorus.sequence(robots.iter().map(Commander::next_sequence));
                let robot = robots.get_mut(place).expect("a robot");
                let (part, sent) = robot.part(Order::Still(Still::Rest), sequence, 1_000_000, 5);
                assert_eq!(sent.sequence, sequence);
                chorus.push(part);
            }
            let mut frames = Vec::new();
            chorus.finish(7, tick, 1_000_000, |frame| frames.push(frame.clone()));
            assert_eq!(
                frames.iter().map(|frame| frame.robots().len()).collect::<Vec<_>>(),
                [16, 4]
            );
            for number in 1..=20 {
                let read = frames
                    .iter()
                    .filter_map(|frame| decode_for(frame.as_bytes(), number, &key).ok());
                let headers: Vec<_> = read.map(|frame| frame.header).collect();
                assert_eq!(headers.len(), 1);
                assert_eq!((headers[0].robot, headers[0].epoch), (number, 7));
                assert_eq!((headers[0].sequence, headers[0].tick), (30 + tick, tick));
            }
        }
        chorus.finish(7, 3, 0, |_| panic!("nobody said anything"));
    }
}
