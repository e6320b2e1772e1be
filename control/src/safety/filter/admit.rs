//! Takes in what is seen and wanted of each robot.

use twin::twist::BodyTwist;

use super::{RECORDED_RAD_PER_S, SafetyFilter};
use crate::law::RobotObservation;
use crate::safety::Limits;
use crate::safety::chassis::Motion;
use crate::safety::intervention::Cause;
use crate::safety::listing::{self, COINCIDENT_M};
use crate::vector::{Vector, clip, dot, heading, length, sub, world_from_body, wrap};

/// Turns on their way that are smaller do not count.
const TURNED_RAD: f64 = 0.02;
/// A robot that cannot move sideways turns towards its way round this fast and drives when it points this well.
const DETOUR_TURN_RAD_PER_S: f64 = 1.5;
const DETOUR_POINTING_RAD: f64 = 0.5;

impl SafetyFilter {
    /// Takes in one robot: where it is, whether it may move, and its desired numbers within the speed limits.
    pub(super) fn admit(
        &mut self,
        i: usize,
        observation: Option<&RobotObservation>,
        wanted: &BodyTwist,
        intended: &BodyTwist,
    ) {
        let limits = self.limits;
        let place = &mut self.places[i];
        place.radius_m = self.radii_m[i];
        self.numbers[i] = [0.0; 3];
        self.desired[i] = [0.0; 3];
        self.intents[i] = [0.0, 0.0];
        self.slowing[i] = false;
        self.swung[i] = false;
        self.steered_out[i] = false;
        let stop = self.must_stop(i, observation, wanted);
        self.stops[i] = stop;
        let place = &mut self.places[i];
        place.movable = stop.is_none();
        let Some(seen) = observation.filter(|seen| seen.pose.is_finite()) else {
            place.velocity = [0.0, 0.0];
            place.reaction_s = self.latencies_s[i] + limits.oldest_pose_s;
            place.pending_m = self.pipelines[i].pending(place.reaction_s).0;
            place.radius_m += limits.stale_growth_m;
            return;
        };
        place.position = Some([seen.pose.x_m, seen.pose.y_m]);
        let age_s = if seen.pose_age_s.is_finite() {
            seen.pose_age_s.max(0.0)
        } else {
            f64::MAX
        };
        if age_s > limits.oldest_pose_s {
            place.radius_m += (limits.stale_growth_m_per_s * age_s).min(limits.stale_growth_m);
        }
        place.reaction_s = self.latencies_s[i] + age_s.min(limits.oldest_pose_s);
        let (pending_m, turned_rad) = self.pipelines[i].pending(place.reaction_s);
        place.pending_m = pending_m;
        let body_velocity = [seen.twist.forward_m_per_s, seen.twist.left_m_per_s];
        let known = body_velocity[0].is_finite() && body_velocity[1].is_finite();
        place.heading = heading(seen.pose.yaw_rad);
        place.turns = turned_rad.abs() > TURNED_RAD;
        place.later = if place.turns {
            heading(seen.pose.yaw_rad + turned_rad)
        } else {
            place.heading
        };
        place.velocity = if known {
            clip(
                world_from_body(body_velocity, seen.pose.yaw_rad),
                2.0 * limits.speed_m_per_s,
            )
        } else {
            [0.0, 0.0]
        };
        if place.movable {
            self.wish(i, wanted, intended);
        }
    }

    /// Why a robot may not move at all.
    pub(super) fn must_stop(
        &self,
        i: usize,
        observation: Option<&RobotObservation>,
        wanted: &BodyTwist,
    ) -> Option<Cause> {
        let late = || (!self.latency_known[i]).then_some(Cause::Latency);
        stop_cause(observation, wanted, &self.limits).or_else(late)
    }

    /// Desired numbers of a robot that may move: its own wish or the way round a deadlock.
    fn wish(&mut self, i: usize, wanted: &BodyTwist, intended: &BodyTwist) {
        let place = self.places[i];
        let chassis = &self.chassis[i];
        let (own, arc) = chassis.desired(intended, self.curvature[i]);
        let intent = place.world_from_body(chassis.velocity(own, arc));
        self.intents[i] = if intent[0].is_finite() && intent[1].is_finite() {
            intent
        } else {
            [0.0, 0.0]
        };
        if self.moving_unknown || listing::crowded(&place, &self.scene, &self.limits) {
            self.halt(i, Cause::Infeasible);
            return;
        }
        let detour = self.watcher.detour(i, &place).map(|velocity| self.driven(i, velocity));
        let (desired, curvature) = chassis.desired(detour.as_ref().unwrap_or(wanted), self.curvature[i]);
        let curvature = self.steadied(i, curvature);
        if let Motion::Steered { .. } = chassis.motion {
            let lost = wanted.yaw_rate_rad_per_s - curvature * wanted.forward_m_per_s;
            self.steered_out[i] = lost.abs() > RECORDED_RAD_PER_S && wanted.forward_m_per_s.abs() > 1e-6;
        }
        self.curvature[i] = curvature;
        self.desired[i] = desired;
        self.numbers[i] = desired;
    }

    /// Body twist for a velocity in the world.
    fn driven(&self, i: usize, velocity: Vector) -> BodyTwist {
        let body = self.places[i].body_from_world(velocity, true);
        match self.chassis[i].motion {
            Motion::Holonomic => BodyTwist {
                forward_m_per_s: body[0],
                left_m_per_s: body[1],
                yaw_rate_rad_per_s: 0.0,
            },
            Motion::Axis { along } => {
                // Forwards or backwards, whichever needs less turning.
                let angle = wrap(libm::atan2(body[1], body[0]) - libm::atan2(along[1], along[0]));
                let half_turn = core::f64::consts::PI;
                let error = if angle.abs() > half_turn / 2.0 {
                    angle - half_turn.copysign(angle)
                } else {
                    angle
                };
                let share = (1.0 - error.abs() / DETOUR_POINTING_RAD).max(0.0);
                let speed = dot(body, along) * share;
                BodyTwist {
                    forward_m_per_s: speed * along[0],
                    left_m_per_s: speed * along[1],
                    yaw_rate_rad_per_s: (4.0 * error).clamp(-DETOUR_TURN_RAD_PER_S, DETOUR_TURN_RAD_PER_S),
                }
            }
            Motion::Steered { least_radius_m } => {
                let speed = length(body).copysign(body[0]);
                let curvature = (2.0 * body[1].copysign(body[1] * speed) / (length(body) * 0.3).max(1e-6))
                    .clamp(-1.0 / least_radius_m, 1.0 / least_radius_m);
                BodyTwist {
                    forward_m_per_s: speed,
                    left_m_per_s: 0.0,
                    yaw_rate_rad_per_s: curvature * speed,
                }
            }
        }
    }

    /// A robot that was never seen could be anywhere; robots in one place have no direction between them.
    pub(super) fn stop_the_unknown(&mut self) {
        let n = self.places.len();
        if self.places.iter().any(|place| place.position.is_none()) {
            for i in 0..n {
                self.places[i].movable = false;
                self.stops[i].get_or_insert(Cause::PoseAge);
            }
        }
        for j in 0..n {
            for i in 0..j {
                let (Some(a), Some(b)) = (self.places[i].position, self.places[j].position) else {
                    continue;
                };
                if (a[0] - b[0]).abs() < COINCIDENT_M && length(sub(a, b)) < COINCIDENT_M {
                    for k in [i, j] {
                        self.places[k].movable = false;
                        self.stops[k].get_or_insert(Cause::Infeasible);
                    }
                }
            }
        }
    }
}

fn stop_cause(observation: Option<&RobotObservation>, wanted: &BodyTwist, limits: &Limits) -> Option<Cause> {
    let Some(seen) = observation else {
        return Some(Cause::Offline);
    };
    let finite =
        wanted.forward_m_per_s.is_finite() && wanted.left_m_per_s.is_finite() && wanted.yaw_rate_rad_per_s.is_finite();
    if !seen.online {
        Some(Cause::Offline)
    } else if !seen.pose.is_finite() || !finite {
        Some(Cause::NotFinite)
    } else if !(0.0..=limits.oldest_pose_s).contains(&seen.pose_age_s) {
        Some(Cause::PoseAge)
    } else {
        None
    }
}
