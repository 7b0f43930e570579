//! What sensors and their libraries leave: recordings of OpenNI, dumps of libfreenect, and a live stream on the disk.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use oni_writer::{Kind, Stream};
use scanner::pictures::{decode_color, decode_depth};
use serde_json::Value;
use tempfile::TempDir;

use super::support::{Ran, command, json, mug, names, nothing_half_written, scan};

const OPENNI2: [&str; 2] =
    ["/usr/lib/x86_64-linux-gnu/libOpenNI2.so.0", "/usr/lib/aarch64-linux-gnu/libOpenNI2.so.0"];
const FIELD_OF_VIEW: [f64; 2] = [1.014_468_670_750_743_8, 0.789_809_063_457_491_5];

/// Millimetres and colour of frame `i`, 64x48.
fn depth(i: usize) -> Vec<u16> {
    (0..64 * 48).map(|p| if p % 37 == 0 { 0 } else { 700 + ((p * 7 + i * 31) % 900) as u16 }).collect()
}

fn color(i: usize) -> Vec<[u8; 3]> {
    (0..64 * 48).map(|p| [(p + i) as u8, (p / 7) as u8, (p * 31 + i * 17) as u8]).collect()
}

fn oni(path: &Path, frames: usize, is_mirrored: bool) {
    let stream = |kind, delay: u64, bytes: &dyn Fn(usize) -> Vec<u8>| Stream {
        kind,
        width: 64,
        height: 48,
        fps: 30,
        field_of_view: FIELD_OF_VIEW,
        is_mirrored,
        frames: (0..frames).map(|i| (33_333 * i as u64 + delay, bytes(i))).collect(),
    };
    let depths = stream(Kind::Depth, 0, &|i| depth(i).iter().flat_map(|mm| mm.to_le_bytes()).collect());
    let colors = stream(Kind::Color, 4000, &|i| color(i).into_flattened());
    oni_writer::write(&mut BufWriter::new(File::create(path).unwrap()), &[depths, colors]).unwrap();
}

/// A folder with something to bring in or to record.
struct Home(TempDir);

impl Home {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// OpenNI2 with sensors of its own.
    fn put_mock_sensors(&self, core: &Path) {
        let drivers = self.path("sandbox/OpenNI2/Drivers");
        fs::create_dir_all(&drivers).unwrap();
        std::os::unix::fs::symlink(core, self.path("sandbox/libOpenNI2.so.0")).unwrap();
        let mock = kinect_testing::built("mock-oni-driver", "libmock_oni_driver.so");
        std::os::unix::fs::symlink(mock, drivers.join("libMockKinect.so.0")).unwrap();
    }

    fn import(&self, source: &str, more: &[&str]) -> Ran {
        let (source, rec) = (self.path(source), self.path("rec"));
        scan(["import", source.to_str().unwrap(), "--out", rec.to_str().unwrap()].iter().chain(more))
    }

    fn record(&self, sensor: &str, more: &[&str]) -> Ran {
        let rec = self.path("rec");
        scan(["record", "--sensor", sensor, "--out", rec.to_str().unwrap()].iter().chain(more))
    }

    /// Refused: exit 2, one error with these words, and nothing written.
    #[track_caller]
    fn is_refused(&self, ran: Ran, words: &[&str]) {
        let ran = ran.with_status(2);
        assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
        assert!(words.iter().all(|word| ran.err.contains(word)), "{words:?} are not in {}", ran.err);
        assert!(!names(self.0.path()).contains(&"rec".to_owned()));
        nothing_half_written(self.0.path());
    }
}

/// The recording holds these frames bit by bit.
#[track_caller]
fn check_frames(rec: &Path, count: usize) -> Value {
    let description = json(&rec.join("recording.json"));
    let frames = description["frames"].as_array().unwrap();
    assert_eq!(frames.len(), count);
    for (i, frame) in frames.iter().enumerate() {
        let read = |name: &str| fs::read(rec.join(frame[name].as_str().unwrap())).unwrap();
        assert!(decode_color(&read("color"), 64, 48).unwrap().data == color(i), "colour {i}");
        assert!(decode_depth(&read("depth"), 64, 48, 1000.0).unwrap().data == depth(i), "depth {i}");
        assert_eq!(frame["timestamp_nanos"], 33_333_000 * i + 4_000_000);
    }
    description
}

#[test]
fn an_oni_file_without_loss() {
    if kinect_testing::library(&OPENNI2).is_none() {
        return;
    }
    let home = Home::new();
    oni(&home.path("walk.oni"), 40, false);
    let ran = home.import("walk.oni", &[]).with_status(0);
    assert!(ran.out.contains("40 pairs of pictures"), "{}", ran.out);
    let description = check_frames(&home.path("rec"), 40);
    assert_eq!(description["device"]["backend"], "import");
    assert!((description["color"]["fx"].as_f64().unwrap() - 57.58).abs() < 0.01);
    assert_eq!(description["color"]["fx"], description["depth"]["fx"]);
    nothing_half_written(home.0.path());
}

#[test]
fn an_oni_file_with_cameras_of_the_command_line() {
    if kinect_testing::library(&OPENNI2).is_none() {
        return;
    }
    let home = Home::new();
    oni(&home.path("walk.oni"), 9, false);
    let options = ["--every", "4", "--color-camera", "52,52,31,23", "--color-from-depth", "-0.025,0,0"];
    home.import("walk.oni", &options).with_status(0);
    let description = json(&home.path("rec/recording.json"));
    assert_eq!(description["frames"].as_array().unwrap().len(), 3);
    assert_eq!(
        (&description["color"]["fx"], &description["color_from_depth"][3]),
        (&52.0.into(), &(-0.025).into())
    );
    assert!((description["depth"]["fx"].as_f64().unwrap() - 57.58).abs() < 0.01);
}

#[test]
fn a_mirrored_oni_file_comes_out_turned() {
    if kinect_testing::library(&OPENNI2).is_none() {
        return;
    }
    let home = Home::new();
    oni(&home.path("walk.oni"), 2, true);
    home.import("walk.oni", &[]).with_status(0);
    let bytes = fs::read(home.path("rec/depth/000001.png")).unwrap();
    let turned = decode_depth(&bytes, 64, 48, 1000.0).unwrap().mirrored();
    assert!(turned.data == depth(1));
    assert!(json(&home.path("rec/recording.json")).get("mirrored").is_none());
}

#[test]
fn oni_files_that_are_none() {
    if kinect_testing::library(&OPENNI2).is_none() {
        return;
    }
    let home = Home::new();
    fs::write(home.path("a.oni"), "Dear Sir or Madam").unwrap();
    home.is_refused(home.import("a.oni", &[]), &["a.oni", "name a .oni file"]);
    oni(&home.path("a.oni"), 5, false);
    let whole = fs::read(home.path("a.oni")).unwrap();
    fs::write(home.path("a.oni"), &whole[..whole.len() / 2]).unwrap();
    home.is_refused(home.import("a.oni", &[]), &["a.oni", "copy it again"]);
}

#[test]
fn openni2_that_is_not_installed() {
    let home = Home::new();
    oni(&home.path("a.oni"), 2, false);
    let mut command = command();
    command.env("SCAN_OPENNI2_LIB", "/nowhere/libOpenNI2.so.0");
    command.arg("import").arg(home.path("a.oni")).arg("--out").arg(home.path("rec"));
    home.is_refused(command.output().unwrap().into(), &["OpenNI2", "/nowhere/libOpenNI2.so.0"]);
}

/// A dump of so many pairs; the clock begins again in its middle.
fn dump(folder: &Path, pairs: u32) {
    fs::create_dir_all(folder).unwrap();
    let mut index = String::new();
    let mut put = |name: String, bytes: Vec<u8>| {
        fs::write(folder.join(&name), bytes).unwrap();
        index.extend([name.as_str(), "\n"]);
    };
    let start = 0u32.wrapping_sub(2_000_000 * (pairs / 2));
    for i in 0..pairs {
        let ticks = start.wrapping_add(i * 2_000_000);
        put(format!("a-1000.{i:06}-{ticks}.dump"), vec![0; 12]);
        let mut bytes = b"P5 640 480 65535\n".to_vec();
        let raw = |p: u32| if p.is_multiple_of(50) { 2047 } else { (500 + p % 300 + i) as u16 };
        bytes.extend((0..640 * 480).flat_map(|p| raw(p).to_le_bytes()));
        put(format!("d-1000.{i:06}-{ticks}.pgm"), bytes);
        let mut bytes = b"P6 640 480 255 \n".to_vec();
        bytes.extend((0..640 * 480u32).flat_map(|p| [p as u8, (p / 640) as u8, i as u8]));
        put(format!("r-1000.{i:06}-{}.ppm", ticks.wrapping_add(240_000)), bytes);
    }
    fs::write(folder.join("INDEX.txt"), index).unwrap();
}

#[test]
fn a_dump_of_libfreenect() {
    let home = Home::new();
    dump(&home.path("dump"), 4);
    let ran = home.import("dump", &[]).with_status(0);
    assert!(ran.out.contains("4 pairs of pictures"), "{}", ran.out);
    let rec = home.path("rec");
    let description = json(&rec.join("recording.json"));
    assert_eq!(description["depth"]["fx"], 575.8);
    assert!((description["color"]["fx"].as_f64().unwrap() - 528.0).abs() < 4.0, "{description}");
    assert!((description["color_from_depth"][3].as_f64().unwrap() + 0.024).abs() < 1e-6, "{description}");
    let frames = description["frames"].as_array().unwrap();
    let times: Vec<u64> = frames.iter().map(|frame| frame["timestamp_nanos"].as_u64().unwrap()).collect();
    assert!(
        times.windows(2).all(|pair| (33_333_332..=33_333_334).contains(&(pair[1] - pair[0]))),
        "{times:?}"
    );
    let read = |name: &str| fs::read(rec.join(name)).unwrap();
    let image = decode_depth(&read("depth/000000.png"), 640, 480, 1000.0).unwrap();
    // Raw 2047 is nothing; raw 700 is 887 mm by the device's usual constants.
    assert_eq!((image.data[0], image.data[200]), (0, 0));
    let image = decode_depth(&read("depth/000001.png"), 640, 480, 1000.0).unwrap();
    assert_eq!(image.data[199], 887);
    assert_eq!(decode_color(&read("color/000003.png"), 640, 480).unwrap().data[641], [129, 1, 3]);
    nothing_half_written(home.0.path());
}

#[test]
fn broken_dumps() {
    type Break = fn(&Path);
    let cases: [(Break, &[&str]); 5] = [
        (
            |dump| fs::write(dump.join("INDEX.txt"), "d-1-2.pgm\nletter.txt\n").unwrap(),
            &["INDEX.txt, line 2", "letter.txt"],
        ),
        (|dump| fs::write(dump.join("INDEX.txt"), "").unwrap(), &["no pair of colour and depth"]),
        (|dump| fs::remove_file(first(dump, "d-")).unwrap(), &["d-1000.000000-", "check that it exists"]),
        (|dump| cut(&first(dump, "d-"), 1000), &["d-1000.000000-", "cut off"]),
        (|dump| cut(&first(dump, "r-"), 5), &["r-1000.000000-", "cut off"]),
    ];
    for (break_it, words) in cases {
        let home = Home::new();
        dump(&home.path("dump"), 1);
        break_it(&home.path("dump"));
        home.is_refused(home.import("dump", &[]), words);
    }
}

fn first(dump: &Path, begin: &str) -> PathBuf {
    dump.join(names(dump).into_iter().find(|name| name.starts_with(begin)).unwrap())
}

fn cut(file: &Path, length: usize) {
    let bytes = fs::read(file).unwrap();
    fs::write(file, &bytes[..length]).unwrap();
}

/// What is replayed and recorded again has the same pixels, be it views or a stream.
#[test]
fn a_replay_recorded_again() {
    let home = Home::new();
    let sensor = format!("replay-fast:{}", mug().display());
    let ran = home.record(&sensor, &["--json"]).with_status(0);
    let result: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(
        (&result["frames"], &result["dropped"], &result["complete"]),
        (&8.into(), &0.into(), &true.into())
    );
    let picture = |folder: &Path, name: &str| {
        let bytes = fs::read(folder.join(name)).unwrap();
        if name.starts_with("color") {
            decode_color(&bytes, 640, 480).unwrap().data.into_flattened()
        } else {
            let depth = decode_depth(&bytes, 640, 480, 1000.0).unwrap();
            depth.data.iter().flat_map(|mm| mm.to_le_bytes()).collect()
        }
    };
    for i in 0..8 {
        let depth = format!("depth/{i:06}.png");
        assert!(picture(&home.path("rec"), &depth) == picture(mug(), &depth));
        // The frames of a view share their colour picture.
        let (color, shared) = (format!("color/{i:06}.png"), format!("color/{:06}.png", i / 2));
        assert!(picture(&home.path("rec"), &color) == picture(mug(), &shared));
    }
    nothing_half_written(home.0.path());
}

#[test]
fn recording_until_the_time_is_up_and_until_ctrl_c() {
    let home = Home::new();
    home.record("simulated", &["--seconds", "1"]).with_status(0);
    let frames = json(&home.path("rec/recording.json"))["frames"].as_array().unwrap().len();
    assert!((2..=31).contains(&frames), "{frames}");
    let mut command = command();
    command.args(["record", "--sensor", "simulated", "--quiet", "--json", "--out"]).arg(home.path("long"));
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while !home.path("long.partial/depth/000002.png").exists() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let ran = Ran::from(child.wait_with_output().unwrap()).with_status(0);
    let result: Value = serde_json::from_str(&ran.out).unwrap();
    let kept = json(&home.path("long/recording.json"))["frames"].as_array().unwrap().len();
    assert!(kept >= 3 && result["frames"] == kept, "{result}");
    nothing_half_written(home.0.path());
}

#[test]
fn what_is_left_of_a_recording_that_was_killed_can_be_used() {
    let home = Home::new();
    let mut command = command();
    command
        .args(["record", "--sensor", "simulated:mug", "--seconds", "90", "--quiet", "--out"])
        .arg(home.path("rec"));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let left = home.path("rec.partial");
    let listed = || {
        let bytes = fs::read(left.join("recording.json")).unwrap_or_default();
        let description: Value = serde_json::from_slice(&bytes).unwrap_or_default();
        description["frames"].as_array().map_or(0, Vec::len)
    };
    let deadline = std::time::Instant::now() + Duration::from_mins(1);
    while listed() < 20 {
        assert!(std::time::Instant::now() < deadline && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let recording = scanner::recording::Recording::open(&left).unwrap();
    assert!(recording.view_names().len() >= 20);
    for view in 0..recording.view_names().len() {
        recording.load_view(view).unwrap();
    }
    // The next recording takes nothing away from it.
    home.record("simulated:mug", &["--seconds", "0.5"]).with_status(0);
    assert_eq!(names(home.0.path()), ["rec", "rec.partial"]);
}

#[test]
fn sensors_that_are_not_there() {
    let home = Home::new();
    for (sensor, words) in [
        ("webcam", ["webcam", "openni2"]),
        ("", ["openni2", "freenect"]),
        ("replay:/nowhere", ["/nowhere", "recording.json"]),
        ("openni2:/nowhere/a.oni", ["/nowhere/a.oni", "check the path"]),
    ] {
        if sensor.starts_with("openni2") && kinect_testing::library(&OPENNI2).is_none() {
            continue;
        }
        home.is_refused(home.record(sensor, &["--seconds", "1"]), &words);
    }
}

/// A sensor that streams at 30 frames a second, in bounds of memory. A computer that is busy with other things may lose
/// frames, and then says how many; `make capture-load` measures that an idle one loses none.
#[test]
fn a_live_sensor_is_recorded_and_what_is_lost_is_said() {
    let Some(core) = kinect_testing::library(&OPENNI2) else { return };
    let home = Home::new();
    home.put_mock_sensors(&core);
    println!("{} frames missing", record_live(&home));
}

#[test]
fn two_sensors_of_openni2_have_addresses_of_their_own() {
    let Some(core) = kinect_testing::library(&OPENNI2) else { return };
    let home = Home::new();
    home.put_mock_sensors(&core);
    let run = |arguments: &[&str]| {
        let mut command = command();
        command.env("SCAN_OPENNI2_LIB", home.path("sandbox/libOpenNI2.so.0")).env("MOCK_KINECT_SECOND", "1");
        let command = command.env("SCAN_USB_ROOT", home.path("nowhere")).arg("--json").args(arguments);
        let ran = Ran::from(command.output().unwrap()).with_status(0);
        serde_json::from_str::<Value>(&ran.out).unwrap()
    };
    let found = run(&["devices"]);
    let sensors = found["sensors"].as_array().unwrap();
    assert_eq!(sensors.len(), 2, "{found}");
    let addresses = [mock_oni_driver::URI, mock_oni_driver::SECOND_URI].map(|uri| format!("openni2:{uri}"));
    for ((sensor, address), serial) in sensors.iter().zip(addresses).zip(mock_oni_driver::SERIALS) {
        assert_eq!(
            (&sensor["address"], &sensor["usable"]),
            (&Value::from(address.clone()), &Value::from(true))
        );
        let out = home.path(serial);
        run(&["record", "--sensor", &address, "--seconds", "0.3", "--out", out.to_str().unwrap()]);
        assert_eq!(json(&out.join("recording.json"))["device"]["serial"], serial);
    }
}

/// Records three seconds; how many frames are missing, as said and as the numbers in the pictures have it.
fn record_live(home: &Home) -> u64 {
    let mut command = command();
    command.env("SCAN_OPENNI2_LIB", home.path("sandbox/libOpenNI2.so.0"));
    command
        .args(["record", "--sensor", "openni2", "--seconds", "3", "--json", "--out"])
        .arg(home.path("rec"));
    let ran = Ran::from(command.output().unwrap()).with_status(0);
    let result: Value = serde_json::from_str(&ran.out).unwrap();
    let number = |name: &str| result[name].as_f64().unwrap();
    assert!(number("peak_memory_bytes") < f64::from(200 << 20), "{result}");
    let rec = home.path("rec");
    assert_eq!(json(&rec.join("recording.json"))["device"]["backend"], "openni2");
    let frames = result["frames"].as_u64().unwrap();
    let numbers: Vec<u32> = (0..frames as u32).map(|index| number_of(&rec, index)).collect();
    assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "{numbers:?}");
    let missing = u64::from(numbers[numbers.len() - 1] - numbers[0]) + 1 - frames;
    assert_eq!(result["missing"], missing, "{result}");
    missing
}

fn number_of(rec: &Path, index: u32) -> u32 {
    let bytes = fs::read(rec.join(format!("depth/{index:06}.png"))).unwrap();
    let depth = decode_depth(&bytes, 640, 480, 1000.0).unwrap().data;
    let number = u32::from(depth[0]);
    assert!(depth == mock_oni_driver::picture::depth(number), "frame {index}");
    number
}
