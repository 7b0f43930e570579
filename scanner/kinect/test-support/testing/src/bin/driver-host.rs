//! Runs drivers for the tests as `scan-product __driver` does, and others that misbehave as C libraries do.

#[path = "driver-host/format.rs"]
mod format;

use std::ffi::OsString;
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use kinect::child::{ChildSource, Launch};
use kinect::source::{Event, SensorInfo, Source};
use kinect::wire::{Message, Stamped};
use kinect::worker::{self, Driver, DriverError, Link, Request};
use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;
use rustix::process::{Signal, getpid, kill_process};

fn main() -> ExitCode {
    let args: Vec<OsString> = std::env::args_os().skip(2).collect();
    if std::env::args().nth(1).as_deref() == Some("hold") {
        hold(&args);
    }
    let of_tests: [(&str, Driver); 2] = [("misbehave", misbehave), ("freenect-format", format::run)];
    if of_tests.iter().any(|(name, _)| args.first().is_some_and(|arg| arg == name)) {
        return ExitCode::from(worker::run_one_of(&of_tests, &args));
    }
    ExitCode::from(worker::run(&args))
}

/// `HOW` or `HOW-at-once`: streams ten pairs, then does what the target says.
fn misbehave(request: &Request, link: &mut Link) -> Result<(), DriverError> {
    let (how, at_once) = match request.target.strip_suffix("-at-once") {
        Some(how) => (how, true),
        None => (request.target.as_str(), false),
    };
    if !at_once {
        link.opened(info())?;
        for index in 0..10 {
            send_pair(link, index)?;
        }
    }
    match how {
        "abort" => std::process::abort(),
        "exit" => std::process::exit(3),
        "segfault" => segfault()?,
        "panic" => panic!("on purpose"),
        "hang" => hang(),
        "chatter" => println!("a library prints what it likes"),
        "starve" => {
            while !link.is_over() {
                link.alive()?;
                thread::sleep(Duration::from_millis(20));
            }
        }
        "stubborn" => {
            // Never looks whether it is over.
            for index in 10.. {
                let _ = send_pair(link, index);
                thread::sleep(Duration::from_millis(10));
            }
        }
        "end" => link.send(&Message::Ended)?,
        "fail" => return Err(DriverError::other("on purpose")),
        "stream" => {
            let mut index = 10;
            while !link.is_over() {
                if let Some(control) = link.order() {
                    link.answer(Err(format!("asked for {control:?}")))?;
                }
                send_pair(link, index)?;
                index += 1;
                thread::sleep(Duration::from_millis(5));
            }
        }
        other => return Err(DriverError::other(format!("no such misbehaviour: {other}"))),
    }
    Ok(())
}

/// The program's side, for tests that kill it: opens and starts a sensor, says so, and holds it.
fn hold(args: &[OsString]) -> ! {
    let [driver, target] = args else { panic!("hold DRIVER TARGET") };
    let launch =
        Launch::new(&driver.to_string_lossy(), &target.to_string_lossy()).expect("this program has a path");
    let mut source = ChildSource::open(launch).expect("the sensor opens");
    source.start().expect("the sensor starts");
    while !matches!(source.next_event(Duration::from_secs(1)), Event::Frame(_)) {}
    println!("ready");
    hang()
}

fn segfault() -> Result<(), DriverError> {
    // The standard library's handler takes the first one, which comes from no faulty address, and then stands aside.
    for _ in 0..2 {
        kill_process(getpid(), Signal::SEGV).map_err(|error| DriverError::other(error.to_string()))?;
    }
    hang()
}

fn hang() -> ! {
    loop {
        thread::sleep(Duration::from_secs(1));
    }
}

fn send_pair(link: &mut Link, index: u64) -> Result<(), DriverError> {
    let timestamp_nanos = index * 33_333_333;
    let image = ColorImage::filled(64, 48, [index as u8; 3]);
    link.send(&Message::Color(Stamped { image, timestamp_nanos, lost_packets: 0 }))?;
    let data = vec![index as u16; 64 * 48];
    let image = DepthImage { width: 64, height: 48, data, units_per_metre: 1000.0 };
    link.send(&Message::Depth(Stamped {
        image,
        timestamp_nanos: timestamp_nanos + 1_000_000,
        lost_packets: 0,
    }))
}

fn info() -> SensorInfo {
    let camera = Intrinsics::pinhole(64, 48, 52.5, 52.5, 31.5, 23.5);
    SensorInfo {
        backend: "misbehave".into(),
        address: "misbehave".into(),
        model: "none".into(),
        serial: String::new(),
        rig: Rig { color: camera, depth: camera, color_from_depth: Pose::identity() },
        units_per_metre: 1000.0,
        abilities: vec![kinect::source::Ability::Tilt],
    }
}
