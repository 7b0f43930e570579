use kinect::source::Source;
use reconstruct::board::Family;
use reconstruct::image::{ColorImage, DepthImage};

use super::*;
use crate::capture::simulated::Simulated;
use crate::simulate::{Paper, ring};

fn seen() -> (Watched, SensorInfo, KnownBoard) {
    let board = ring(Paper::A3, Family::Aruco4x4_50);
    let mut source = Simulated::open("simulated:crackerbox:3", Some(&board)).unwrap();
    let watched = watch(&mut source, 0.6).unwrap();
    (watched, source.sensor().clone(), board)
}

#[track_caller]
fn check(findings: &[Finding], code: &str, level: Level, words: &str) {
    let found = findings.iter().find(|f| f.code == code);
    let found = found.unwrap_or_else(|| panic!("no {code} in {findings:#?}"));
    assert!(found.level == level && found.text.contains(words), "{found:?}");
}

#[test]
fn a_good_sensor_has_nothing_red() {
    let (watched, sensor, board) = seen();
    let findings = judge(&watched, &sensor, Some(&board));
    check(&findings, "tags", Level::Green, "of the board's");
    check(&findings, "depth_scale", Level::Green, "corrects that");
    check(&findings, "pixel_offset", Level::Green, "pixels apart");
    check(&findings, "lost_packets", Level::Green, "No USB packet");
    assert!(findings.iter().all(|f| f.level < Level::Red), "{findings:#?}");
}

/// The newest frames with something changed about them.
fn changed(watched: &Watched, change: impl Fn(&mut Frame)) -> Watched {
    let kept = watched.kept.iter().map(|frame| {
        let mut frame = frame.as_ref().clone();
        change(&mut frame);
        Arc::new(frame)
    });
    Watched { kept: kept.collect(), ..watched.clone() }
}

#[test]
fn what_is_wrong_is_named_with_what_to_do() {
    let (watched, sensor, board) = seen();
    let check_changed = |change: &dyn Fn(&mut Frame), code, level, words| {
        check(&judge(&changed(&watched, change), &sensor, Some(&board)), code, level, words);
    };
    let scaled = |factor: f64| {
        move |frame: &mut Frame| {
            let depth = Arc::make_mut(&mut frame.depth);
            depth.data.iter_mut().for_each(|raw| *raw = (f64::from(*raw) * factor).round() as u16);
        }
    };
    check_changed(&scaled(1.025), "depth_scale", Level::Yellow, "scan-product calibrate");
    check_changed(&scaled(0.94), "depth_scale", Level::Red, "ruler");
    let shifted = |frame: &mut Frame| {
        let depth = Arc::make_mut(&mut frame.depth);
        depth.data.rotate_left(7);
    };
    check_changed(&shifted, "pixel_offset", Level::Yellow, "to the right");
    let no_depth = |frame: &mut Frame| {
        let depth = Arc::make_mut(&mut frame.depth);
        depth.data.iter_mut().step_by(8).for_each(|raw| *raw = 0);
        depth.data.iter_mut().enumerate().filter(|(i, _)| i % 8 > 1).for_each(|(_, raw)| *raw = 0);
    };
    check_changed(&no_depth, "valid_depth", Level::Red, "distance");
    let sunny = |frame: &mut Frame| {
        no_depth(frame);
        Arc::make_mut(&mut frame.color).data.fill([240; 3]);
    };
    check_changed(&sunny, "valid_depth", Level::Red, "sunlight");
    let dark = |frame: &mut Frame| Arc::make_mut(&mut frame.color).data.fill([9; 3]);
    check_changed(&dark, "light", Level::Yellow, "lamp");
    check_changed(&dark, "tags", Level::Red, "cannot be found");
    let late = Watched { pair_seconds: vec![0.03; 9], ..watched.clone() };
    check(&judge(&late, &sensor, None), "time_offset", Level::Yellow, "nothing moves");
    let lossy = Watched { lost_packets: 5, skipped: 3, ..watched.clone() };
    check(&judge(&lossy, &sensor, None), "lost_packets", Level::Yellow, "another port");
    check(&judge(&lossy, &sensor, None), "computer", Level::Yellow, "close other programs");
    let slow = Watched { frames: 10, seconds: 1.5, ..watched.clone() };
    check(&judge(&slow, &sensor, None), "frame_rate", Level::Red, "USB 2 port");
    let gone = Watched { trouble: Some("it was unplugged".into()), ..watched.clone() };
    check(&judge(&gone, &sensor, None), "frame_rate", Level::Red, "unplugged");
    check(&judge(&Watched::default(), &sensor, None), "frame_rate", Level::Red, "power supply");
}

#[test]
fn the_same_marker_twice() {
    let (watched, sensor, board) = seen();
    // The left half of the picture once more on the right: markers there occur twice.
    let doubled = changed(&watched, |frame| {
        let color: &mut ColorImage = Arc::make_mut(&mut frame.color);
        for row in color.data.chunks_exact_mut(640) {
            row.copy_within(0..320, 320);
        }
    });
    check(&judge(&doubled, &sensor, Some(&board)), "duplicate_tags", Level::Red, "more than once");
}

#[test]
fn an_offset_is_measured() {
    let (watched, _, _) = seen();
    let frame = watched.kept.last().unwrap();
    let gray = frame.color.to_gray();
    let depth: &DepthImage = &frame.depth;
    let metres: Vec<f32> = depth.data.iter().map(|&raw| f32::from(raw) / 1000.0).collect();
    let offset = |shift: usize| {
        let mut moved = metres.clone();
        moved.rotate_left(shift);
        color_depth_offset(&gray, &moved).unwrap()
    };
    let (still, moved) = (offset(0), offset(6 + 640 * 4));
    assert!(still[0].hypot(still[1]) < 2.0, "{still:?}");
    assert!((moved[0] - still[0] - 6.0).abs() < 1.0 && (moved[1] - still[1] - 4.0).abs() < 1.0, "{moved:?}");
    assert_eq!(color_depth_offset(&gray, &vec![1.0; metres.len()]), None);
}
