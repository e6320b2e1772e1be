//! How two robots of an adversarial run, or a robot and one of no run, came as close as they did: a table of the time before.

use crate::attack::Attack;
use anyhow::Result;
use lab::record::{Command, Record};

/// Seconds that are told before the closest moment, and after it.
const BEFORE_S: f64 = 2.0;
const AFTER_S: f64 = 0.1;

/// One control tick.
struct Moment {
    /// Of the robots of the run, then of the others.
    poses: Vec<[f64; 3]>,
    speeds_m_per_s: Vec<f64>,
    commands: Vec<Command>,
    latched: Vec<bool>,
}

impl Moment {
    fn distance_m(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (self.poses[a], self.poses[b]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    }
}

/// Repeats the run and prints, tick by tick, both robots of its closest pair, those of no run behind the others: true pose and speed, what was wanted and what was sent.
///
/// - Errors: a run that cannot be set up, or has one robot.
pub fn print(attack: &Attack) -> Result<()> {
    let mut moments: Vec<Moment> = Vec::new();
    let count = attack.chassis.len();
    let outcome = attack.run_watched(true, |rig| {
        let commands = rig.records.drain(..).filter_map(|record| match record {
            Record::Command(command) => Some(command),
            _ => None,
        });
        let commands = commands.collect();
        let mut poses = rig.poses();
        let mut speeds_m_per_s: Vec<f64> = (0..poses.len()).map(|place| rig.speed_m_per_s(place)).collect();
        let mut latched: Vec<bool> = rig.watches().iter().map(|watch| watch.latched_us.is_some()).collect();
        for (place, (_, pose)) in rig.strangers.iter().enumerate() {
            let before = moments
                .last()
                .and_then(|moment| moment.poses.get(count + place))
                .unwrap_or(pose);
            speeds_m_per_s.push(120.0 * (pose[0] - before[0]).hypot(pose[1] - before[1]));
            poses.push(*pose);
            latched.push(false);
        }
        moments.push(Moment {
            speeds_m_per_s,
            poses,
            commands,
            latched,
        });
    })?;
    println!("{outcome:?}\n{:?}", attack.chassis);
    let bodies = moments.first().map_or(0, |moment| moment.poses.len());
    // Those of no run may come to each other as they like.
    let pairs = (0..bodies).flat_map(|a| (0..a.min(count)).map(move |b| (b, a)));
    let all = pairs.flat_map(|(a, b)| {
        moments
            .iter()
            .enumerate()
            .map(move |(tick, moment)| (moment.distance_m(a, b), tick, a, b))
    });
    let Some((distance_m, at, a, b)) = all.min_by(|x, y| x.0.total_cmp(&y.0)) else {
        anyhow::bail!("one robot alone has no neighbour");
    };
    println!(
        "robots {} and {}, centres {distance_m:.4} m apart at {:.3} s",
        a + 1,
        b + 1,
        at as f64 / 120.0
    );
    println!(
        "time_s gap_mm | robot x_m y_m yaw_deg true_m/s pose_age_ms link_age_ms wanted(forward left yaw) sent(forward left yaw)"
    );
    let from = at.saturating_sub((BEFORE_S * 120.0) as usize);
    let to = (at + (AFTER_S * 120.0) as usize).min(moments.len());
    for (tick, moment) in moments.iter().enumerate().take(to).skip(from) {
        print!(
            "{:.3} {:7.1}",
            tick as f64 / 120.0,
            1e3 * (moment.distance_m(a, b) - 2.0 * crate::attack::RADIUS_M)
        );
        for place in [a, b] {
            let [x_m, y_m, yaw] = moment.poses[place];
            print!(
                " | {} {x_m:.3} {y_m:.3} {:.0} {:.3}",
                place + 1,
                yaw.to_degrees(),
                moment.speeds_m_per_s[place]
            );
            print!("{}", if moment.latched[place] { " latched" } else { "" });
            if let Some(command) = moment
                .commands
                .iter()
                .find(|command| usize::from(command.robot) == place + 1)
            {
                let told = |twist: [f64; 3]| format!("({:.2} {:.2} {:.2})", twist[0], twist[1], twist[2]);
                print!(
                    " {:.0} {:.0} {} {}{}",
                    1e-3 * command.pose_age_us as f64,
                    1e-3 * command.link_age_us as f64,
                    told(command.desired),
                    told(command.twist),
                    if command.enable { "" } else { " off" }
                );
            }
        }
        println!();
    }
    Ok(())
}
