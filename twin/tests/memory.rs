//! Memory of a world per robot, and that a tick on an open floor allocates nothing.

use twin::parameter::CHASSIS;
use twin::workload::{Variation, Workload};

#[path = "support/allocation.rs"]
mod allocation;

#[global_allocator]
static ALLOCATOR: allocation::Counting = allocation::Counting;

/// Most memory of one more robot in a world, bytes.
const MOST_BYTES_PER_ROBOT: usize = 8 * 1024;

/// One test, because the counters are those of the whole program.
#[test]
fn a_robot_takes_less_than_8_kilobytes_and_a_tick_none() {
    for chassis in CHASSIS {
        for variation in Variation::ALL {
            let world_bytes = |count: usize| {
                let work = Workload::new(chassis, count, variation, true).expect("workload");
                let before = allocation::held_bytes();
                // At the end of a lap: buffers that fill while driving belong to it.
                let world = work.lap().expect("finite");
                let bytes = allocation::held_bytes() - before;
                drop(world);
                bytes
            };
            let (one, many) = (world_bytes(1), world_bytes(101));
            let each = (many - one) / 100;
            println!("{chassis} {}: {each} bytes a robot", variation.name());
            assert!(each > 200, "{each} bytes cannot hold a robot's state");
            assert!(each <= MOST_BYTES_PER_ROBOT, "{chassis}: {each} bytes a robot");
        }
        let work = Workload::new(chassis, 10, Variation::FloorFriction, true).expect("workload");
        let mut world = work.lap().expect("finite");
        let before = allocation::calls();
        for tick in 0..120 {
            world.step(work.commands(tick)).expect("finite");
        }
        assert_eq!(allocation::calls() - before, 0, "{chassis} allocates while driving");
    }
}
