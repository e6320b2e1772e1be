//! From the chosen numbers to commands, and the record of what was changed.

use twin::twist::BodyTwist;

use super::{RECORDED_RAD_PER_S, SafetyFilter, stop_holding};
use crate::safety::deadlock::Hold;
use crate::safety::intervention::{Cause, Intervention, Strongest};
use crate::safety::rows::{NOBODY, Source};
use crate::safety::{Filtered, SafeCommand};
use crate::vector::{length, sub};

/// A change below this is not recorded.
const RECORDED_M_PER_S: f64 = 2e-3;
/// A row that pushes less than this is not recorded.
const PUSHED_M_PER_S: f64 = 1e-4;

impl SafetyFilter {
    /// Which rows acted on whom, and how much.
    pub(super) fn weigh(&mut self) {
        self.strongest.fill(Strongest::NONE);
        self.holds.fill(Hold::Nothing);
        for row in self.listing.rows.iter().filter(|row| row.multiplier > 0.0) {
            for k in 0..2 {
                let (robot, other) = (row.robots[k], row.robots[1 - k]);
                if robot == NOBODY || !self.places[robot as usize].movable {
                    continue;
                }
                let gradient = row.gradient[k];
                let size = crate::safety::rows::inner(&gradient, &gradient).sqrt();
                let push_m_per_s = row.multiplier * size;
                if push_m_per_s > PUSHED_M_PER_S {
                    self.strongest[robot as usize].add(row.source.cause(other), push_m_per_s);
                    let hold = &mut self.holds[robot as usize];
                    *hold = match (row.source, *hold) {
                        (Source::Robot, _) | (_, Hold::Robot) => Hold::Robot,
                        (Source::Wall(_) | Source::Fence(_) | Source::Obstacle { .. } | Source::Moving(_), _) => {
                            Hold::Wall
                        }
                        (_, before) => before,
                    };
                }
            }
        }
    }

    /// Command and record of one robot.
    pub(super) fn finish(&mut self, i: usize, requested: BodyTwist) -> Filtered {
        let command = if self.places[i].movable {
            self.driving(i)
        } else if self.slowing[i] {
            self.slower(i)
        } else {
            stop_holding(self.steering_rad[i])
        };
        self.send(i, command);
        Filtered {
            command,
            intervention: self.judge(i, requested, command.twist),
        }
    }

    /// The chosen numbers as set-points. Their rows say that the wheels can do it; if they cannot, the robot stops.
    fn driving(&mut self, i: usize) -> SafeCommand {
        let chassis = &self.chassis[i];
        let twist = chassis.twist(self.numbers[i], self.curvature[i]);
        let wheels = chassis.robot().wheel_speeds_holding(twist, self.steering_rad[i]);
        let limit = chassis.wheel_limit_rad_per_s() * (1.0 + 1e-6);
        let fits = wheels.wheel_rad_per_s.iter().all(|speed| speed.abs() <= limit);
        if fits && wheels.non_finite_field().is_none() {
            return SafeCommand { twist, wheels };
        }
        self.stops[i].get_or_insert(Cause::NotConverged);
        self.places[i].movable = false;
        self.kept[i] = self.kept_among(i, |k| k == i);
        self.slower(i)
    }

    /// Remembers what a robot is told.
    pub(super) fn send(&mut self, i: usize, command: SafeCommand) {
        let twist = command.twist;
        let curvature = if twist.forward_m_per_s == 0.0 {
            0.0
        } else {
            twist.yaw_rate_rad_per_s / twist.forward_m_per_s
        };
        let body = self.chassis[i].velocity(self.chassis[i].numbers(&twist), curvature);
        let velocity = self.places[i].world_from_body(body);
        self.steering_rad[i] = command.wheels.steering_rad;
        self.places[i].commanded = velocity;
        self.pipelines[i].push(velocity, twist.yaw_rate_rad_per_s);
    }

    /// What changed the command most; `None` when nothing did.
    fn judge(&self, i: usize, requested: BodyTwist, applied: BodyTwist) -> Option<Intervention> {
        let strongest = self.strongest[i];
        if let Some(cause) = self.stops[i] {
            return Some(record(cause, requested, applied, strongest));
        }
        let detour = self.watcher.detour(i, &self.places[i]).is_some();
        let rows = strongest.0.iter().flatten();
        let outside = rows
            .clone()
            .find(|one| one.cause.label() != "speed" && one.push_m_per_s > RECORDED_M_PER_S / 2.0);
        let cause = match (detour, outside) {
            (true, _) => Cause::Deadlock,
            (_, Some(found)) => found.cause,
            _ if self.swung[i] => Cause::Turn,
            _ if self.steered_out[i] => Cause::Steering,
            _ => strongest.first().map_or(Cause::Speed, |one| one.cause),
        };
        let intervention = record(cause, requested, applied, strongest);
        let changed =
            intervention.change_m_per_s >= RECORDED_M_PER_S || intervention.change_rad_per_s >= RECORDED_RAD_PER_S;
        changed.then_some(intervention)
    }

    /// Lets the watcher for deadlocks see the tick.
    pub(super) fn watch(&mut self) {
        for i in 0..self.chassis.len() {
            self.velocities[i] = if self.places[i].movable {
                self.velocity(i)
            } else {
                [0.0, 0.0]
            };
        }
        let rows = self.listing.rows[..self.listing.shared].iter();
        let pairs = rows
            .filter(|row| row.multiplier > 0.0 && row.source == Source::Robot)
            .map(|row| row.robots);
        self.watcher
            .look(&self.places, &self.intents, &self.velocities, &self.holds, pairs);
    }
}

pub(super) fn record(cause: Cause, requested: BodyTwist, applied: BodyTwist, strongest: Strongest) -> Intervention {
    let change = sub(
        [requested.forward_m_per_s, requested.left_m_per_s],
        [applied.forward_m_per_s, applied.left_m_per_s],
    );
    let turn = requested.yaw_rate_rad_per_s - applied.yaw_rate_rad_per_s;
    let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
    let requested = BodyTwist {
        forward_m_per_s: finite(requested.forward_m_per_s),
        left_m_per_s: finite(requested.left_m_per_s),
        yaw_rate_rad_per_s: finite(requested.yaw_rate_rad_per_s),
    };
    Intervention {
        cause,
        change_m_per_s: finite(length(change)),
        change_rad_per_s: finite(turn.abs()),
        requested,
        pressures: strongest.0,
    }
}
