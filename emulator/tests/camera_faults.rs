//! The camera's fault menu, one by one.

mod rig;

use emulator::camera::faults::{CameraFault, Damage, DeadPixel, DirtSpot};
use emulator::camera::frame::{FrameDecoder, FrameError, encode};
use emulator::camera::misalignment::Misalignment;
use emulator::camera::{Camera, CameraSettings};
use rig::{camera, pose, robot};

fn shot(camera: &mut Camera, id: u16, x_m: f64) -> Vec<u8> {
    let poses = [pose(x_m, 0.2, 0.3)];
    camera
        .expose(0, &[robot(id, &poses)])
        .expect("a picture")
        .pixels
        .to_vec()
}

#[test]
fn a_frozen_camera_repeats_its_bytes_while_sequence_and_time_go_on() {
    let mut camera = camera(0, CameraSettings::default());
    let before = shot(&mut camera, 3, -1.0);
    camera.set_fault(CameraFault::Frozen).expect("a fault");
    let poses = [pose(-0.5, -0.2, 1.3)];
    let frozen = camera.expose(777, &[robot(3, &poses)]).expect("a picture");
    assert_eq!((frozen.header.sequence, frozen.header.mid_exposure_us), (1, 777));
    assert_eq!(frozen.pixels, before);
    camera.set_fault(CameraFault::None).expect("a fault");
    assert_ne!(shot(&mut camera, 3, -0.5), before);
}

#[test]
fn dropped_frames_leave_gaps_in_the_sequence() {
    let mut camera = camera(0, rig::plain());
    camera
        .set_fault(CameraFault::DropFrames { fraction: 0.3 })
        .expect("a fault");
    let sequences: Vec<u64> = (0..400)
        .filter_map(|time| camera.expose(time, &[]).map(|p| p.header.sequence))
        .collect();
    // binomial: 280 +- 9.2
    assert!((250..310).contains(&sequences.len()), "{}", sequences.len());
    assert!(sequences.windows(2).all(|pair| pair[0] < pair[1]) && sequences.last() > Some(&390));
}

#[test]
fn a_camera_of_the_wrong_size_sends_whole_frames_of_half_the_height() {
    let mut camera = camera(0, rig::plain());
    let full = camera.expose(0, &[]).expect("a picture").header;
    camera.set_fault(CameraFault::WrongSize).expect("a fault");
    let half = camera.expose(1, &[]).expect("a picture");
    assert_eq!(
        (half.header.width_px, half.header.height_px),
        (full.width_px, full.height_px / 2)
    );
    let mut bytes = Vec::new();
    encode(&half.header, half.pixels, &mut bytes).expect("a frame");
    let mut decoder = FrameDecoder::new();
    decoder.push(&bytes);
    assert_eq!(decoder.next_frame().expect("sound").expect("whole").header, half.header);
}

#[test]
fn damaged_frames_are_noticed_as_what_they_are() {
    let mut camera = camera(0, rig::plain());
    let fault = |fraction, part| CameraFault::DamageFrames { fraction, part };
    assert!(camera.set_fault(fault(1.1, Damage::Rest)).is_err());
    for part in [Damage::Pixels, Damage::Header, Damage::Rest] {
        camera.set_fault(fault(1.0, part)).expect("a fault");
        let picture = camera.expose(0, &[]).expect("a picture");
        assert_eq!(picture.damage, Some(part));
        let (mut bytes, mut decoder) = (Vec::new(), FrameDecoder::new());
        encode(&picture.header, picture.pixels, &mut bytes).expect("a frame");
        let whole = bytes.clone();
        part.spoil(&mut bytes);
        // What is missing is taken from the frame that follows.
        bytes.extend_from_slice(&whole);
        decoder.push(&bytes);
        let found = decoder.next_frame().expect_err("damaged");
        match part {
            Damage::Header => assert!(matches!(found, FrameError::HeaderCrc { .. }), "{found}"),
            Damage::Pixels | Damage::Rest => assert!(matches!(found, FrameError::PayloadCrc { .. }), "{found}"),
        }
    }
    camera.set_fault(fault(0.3, Damage::Pixels)).expect("a fault");
    let damaged = (0..400).filter(|time| camera.expose(*time, &[]).expect("a picture").damage.is_some());
    // binomial: 120 +- 9.2
    assert!((90..150).contains(&damaged.count()));
}

#[test]
fn swapped_tags_show_each_others_code() {
    let settings = || CameraSettings {
        misalignment: Misalignment::NONE,
        ..CameraSettings::default()
    };
    let mut swapped = camera(0, settings());
    swapped
        .set_fault(CameraFault::SwapTags { tags: [3, 9] })
        .expect("a fault");
    let mut sound = camera(0, settings());
    assert_eq!(shot(&mut swapped, 3, -1.0), shot(&mut sound, 9, -1.0));
    assert_eq!(shot(&mut swapped, 9, -1.0), shot(&mut sound, 3, -1.0));
    assert_eq!(shot(&mut swapped, 5, -1.0), shot(&mut sound, 5, -1.0));
}

#[test]
fn dead_pixels_dirt_and_darkness_change_the_picture_and_end() {
    let still = CameraSettings {
        read_noise_dn: 0.0,
        shot_variance_dn: 0.0,
        ..CameraSettings::default()
    };
    let mut camera = camera(0, still);
    let sound = shot(&mut camera, 1, -1.2);
    let at = |u: usize, v: usize| v * 640 + u;

    let pixels = vec![
        DeadPixel {
            u_px: 7,
            v_px: 5,
            value: 255,
        },
        DeadPixel {
            u_px: 639,
            v_px: 479,
            value: 0,
        },
    ];
    camera.set_fault(CameraFault::DeadPixels { pixels }).expect("a fault");
    let dead = shot(&mut camera, 1, -1.2);
    assert_eq!((dead[at(7, 5)], dead[at(639, 479)]), (255, 0));
    assert_eq!(dead.iter().zip(&sound).filter(|(a, b)| a != b).count(), 2);
    camera.set_fault(CameraFault::None).expect("a fault");

    let spot = DirtSpot {
        u_px: 500.0,
        v_px: 400.0,
        radius_px: 20.0,
        transmission: 0.4,
    };
    camera.set_fault(CameraFault::Dirt { spot }).expect("a fault");
    let dirty = shot(&mut camera, 1, -1.2);
    let share = (f64::from(dirty[at(500, 400)]) - 6.0) / (f64::from(sound[at(500, 400)]) - 6.0);
    assert!((share - 0.4).abs() < 0.02, "{share}");
    assert_eq!(dirty[at(440, 400)], sound[at(440, 400)]);

    camera.set_fault(CameraFault::LightOff).expect("a fault");
    assert!(shot(&mut camera, 1, -1.2).iter().all(|value| *value <= 8));
    camera.set_fault(CameraFault::None).expect("a fault");
    assert_eq!(shot(&mut camera, 1, -1.2), sound);
}
