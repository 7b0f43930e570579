//! `scan-product import`: recordings and models of other programs.

use std::path::PathBuf;

use anyhow::{Context, bail};
use reconstruct::mesh::Mesh;
use reconstruct::pose::{self, Pose};
use serde_json::json;

use crate::cli::DONE;
use crate::import::{self, ImportError, Kind, Options, Written, model, oni, surface};
use crate::result;
use crate::ui::Ui;

/// Depth of a surface where none is given.
const DEPTH: u32 = 8;

const AFTER_HELP: &str = "\
Examples:
  scan-product import rgbd_dataset_freiburg1_xyz --out rec    TUM, BOP and 7-Scenes are recognised
  scan-product import photos --out rec --mirrored \\
      --color-camera 529.2,525.6,328.9,267.5 --depth-camera 594.2,591.0,339.3,242.7 \\
      --color-from-depth 0.02,-0.0007,-0.0109      pairs NAME_rgb.png, NAME_depth.png
  scan-product import walk.oni --out rec                          OpenNI's recording, by libOpenNI2
  scan-product import dump --out rec                              libfreenect's, of fakenect-record
  scan-product import model.asc --out out                       a model: .asc, .ply, .pcd or .glb
  scan-product import cloud.ply --out out --surface poisson     points become a closed surface

Poses that come with the data are kept beside as poses.json, for comparison; build does not use them.";

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// Folder of pictures, a recording (.oni) or a model file
    source: PathBuf,
    /// Folder to write the recording (or the model's files) into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// What kind of folder it is, where it is not found out by itself
    #[arg(long)]
    kind: Option<Kind>,
    /// Colour camera: fx,fy,cx,cy in pixels
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = numbers::<4>, allow_hyphen_values = true)]
    color_camera: Option<[f64; 4]>,
    /// Depth camera, where depth is not registered to colour
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = numbers::<4>, allow_hyphen_values = true)]
    depth_camera: Option<[f64; 4]>,
    /// Distortion of the colour camera
    #[arg(long, value_name = "K1,K2,P1,P2,K3", value_parser = numbers::<5>, allow_hyphen_values = true)]
    color_distortion: Option<[f64; 5]>,
    /// Distortion of the depth camera
    #[arg(long, value_name = "K1,K2,P1,P2,K3", value_parser = numbers::<5>, allow_hyphen_values = true)]
    depth_distortion: Option<[f64; 5]>,
    /// Where the depth camera is, seen from the colour camera: x,y,z in metres (right, down, forward), these with a
    /// rotation vector in radians, or the 16 numbers of the transform row by row
    #[arg(long, value_name = "NUMBERS", value_parser = rigid, allow_hyphen_values = true)]
    color_from_depth: Option<Pose>,
    /// How many units of the depth pictures make a metre: 1000 for millimetres [default: what the kind says, or 1000]
    #[arg(long, value_name = "NUMBER")]
    units_per_metre: Option<f64>,
    /// The pictures are stored flipped left-right (Kinect drivers do so)
    #[arg(long)]
    mirrored: bool,
    /// Whether the pictures are one moving stream, rather than views of a resting camera
    #[arg(long, value_name = "TRUE|FALSE")]
    stream: Option<bool>,
    /// Take every N-th pair of pictures only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Make a surface of a model's points, by their normals where the file has some
    #[arg(long, value_name = "METHOD")]
    surface: Option<surface::Method>,
    /// How fine the surface is: the box round the points has 2^DEPTH cells along an axis, 4 to 10 [default: 8]
    #[arg(long, value_name = "DEPTH", requires = "surface", value_parser = clap::value_parser!(u32).range(4..=10))]
    depth: Option<u32>,
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    if args.surface.is_some() && (!args.source.is_file() || oni::is_one(&args.source)) {
        bail!("--surface is for models (.asc, .ply, .pcd, .glb); a recording gets its surface by build");
    }
    match args.source.is_file() {
        true if oni::is_one(&args.source) => run_oni(args, ui),
        true => run_model(args, ui),
        false => run_folder(args, ui),
    }
}

fn run_model(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let (mesh, warnings) = with_surface(model::read(&args.source)?, args, ui)?;
    let name = args.source.file_name().unwrap_or_default().to_string_lossy().into_owned();
    result::write(&args.out, &mesh, &model::report(&mesh, &name, &warnings))?;
    let (points, triangles) = (mesh.measured_count(), mesh.triangles.len());
    let words = format!("{points} points and {triangles} triangles, written to {}", args.out.display());
    ui.result(&words, &json!({"out": args.out, "points": points, "triangles": triangles}));
    Ok(DONE)
}

/// The model, or the surface of its points with what is to be said of it.
fn with_surface(model: Mesh, args: &Args, ui: &Ui) -> anyhow::Result<(Mesh, Vec<String>)> {
    let Some(surface::Method::Poisson) = args.surface else { return Ok((model, Vec::new())) };
    let depth = args.depth.unwrap_or(DEPTH);
    let stage = ui.stage("Making the surface", 0);
    let made = surface::of_points(model, depth).with_context(|| args.source.display().to_string())?;
    stage.done();
    let warnings = surface::warnings(&made, depth);
    for warning in &warnings {
        ui.warn(warning);
    }
    Ok((made.mesh, warnings))
}

fn run_oni(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    if args.stream == Some(false) {
        bail!("a recording of OpenNI is one moving stream; leave --stream out");
    }
    let stage = ui.stage("Copying frames", 0);
    let written = oni::import(&args.source, &options(args), &args.out, || stage.step())?;
    stage.done();
    say(args, &written, ui);
    Ok(DONE)
}

fn run_folder(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let kind = args.kind.or_else(|| import::detect(&args.source));
    let Some(kind) = kind else { bail!(ImportError::NotRecognised(args.source.clone())) };
    if args.out.canonicalize().is_ok_and(|out| args.source.canonicalize().is_ok_and(|source| source == out)) {
        bail!(
            "{} would be replaced by what is made of it; name another folder with --out",
            args.out.display()
        );
    }
    let mut source = import::read(kind, &args.source)?;
    source.is_stream = args.stream.unwrap_or(source.is_stream);
    let options = options(args);
    let stage = ui.stage("Copying pictures", source.frames.len().div_ceil(options.every));
    let written = import::write(&source, &options, &args.out, || stage.step())?;
    stage.done();
    say(args, &written, ui);
    Ok(DONE)
}

fn options(args: &Args) -> Options {
    Options {
        color_camera: args.color_camera,
        depth_camera: args.depth_camera,
        color_distortion: args.color_distortion,
        depth_distortion: args.depth_distortion,
        color_from_depth: args.color_from_depth,
        units_per_metre: args.units_per_metre,
        mirrored: args.mirrored,
        every: args.every as usize,
    }
}

fn say(args: &Args, written: &Written, ui: &Ui) {
    let words = format!(
        "{} pairs of pictures ({} with poses), written to {}\nNext: scan-product build {} --out out",
        written.frames,
        written.poses,
        args.out.display(),
        args.out.display()
    );
    ui.result(&words, &json!({"out": args.out, "frames": written.frames, "poses": written.poses}));
}

fn list(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| word.trim().parse().ok().filter(|v: &f64| v.is_finite());
    let values: Option<Vec<f64>> = text.split(',').map(number).collect();
    values.ok_or_else(|| format!("{text:?} is not a list of numbers with commas between them"))
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values = list(text)?;
    let count = values.len();
    values.try_into().map_err(|_values: Vec<f64>| format!("{N} numbers are needed, {count} were given"))
}

/// `x,y,z`, `x,y,z,rx,ry,rz` or a row-major matrix.
fn rigid(text: &str) -> Result<Pose, String> {
    let values = list(text)?;
    match values.as_slice() {
        &[x, y, z] => Ok(Pose::translation(x, y, z)),
        &[x, y, z, a, b, c] => Ok(Pose::new([x, y, z].into(), [a, b, c].into())),
        rows => <[f64; 16]>::try_from(rows)
            .ok()
            .and_then(|rows| pose::from_row_major(&rows))
            .ok_or_else(|| "give x,y,z, x,y,z,rx,ry,rz or the 16 numbers of a rigid transform".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_in_three_ways() {
        assert_eq!(rigid("0.1,-0.2,0.3").unwrap(), Pose::translation(0.1, -0.2, 0.3));
        let turned = rigid("0,0,0,0,0,1.5707963267948966").unwrap();
        assert!((turned.rotation.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!(rigid("1,0,0,0,0,1,0,0,0,0,1,0.5,0,0,0,1").unwrap(), Pose::translation(0.0, 0.0, 0.5));
        assert!(rigid("2,0,0,0,0,1,0,0,0,0,1,0.5,0,0,0,1").is_err());
        assert!(rigid("1,2").is_err());
    }

    #[test]
    fn lists_of_the_right_length() {
        assert_eq!(numbers::<4>("525, 525,319.5,239.5"), Ok([525.0, 525.0, 319.5, 239.5]));
        assert!(numbers::<4>("525,525").unwrap_err().contains("4 numbers are needed, 2"));
        assert!(numbers::<1>("nan").is_err());
    }
}
