//! The arguments of all examples.

use super::volumes::{Spacing, parse_spacing};
use bevy::prelude::*;
use bevy_surgery::skin::OrganPreset;
use std::path::PathBuf;

/// Where the models' kernels run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Backend {
    /// Draw, and move fluid on the GPU.
    Gpu,
    /// Run the models alone: no picture, only the report.
    Cpu,
}

/// What is done with nobody there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Script {
    /// Nothing: the organ turns.
    #[default]
    None,
    /// Everything that the example can do.
    Demo,
}

impl Script {
    /// Steps that it takes.
    pub fn steps(self) -> u32 {
        match self {
            Self::None => 60,
            Self::Demo => 660,
        }
    }
}

/// Arguments of every example. With a display a window opens; without one, or with --out, frames are drawn headless
/// and written with a report.json. Relative paths count from the working folder.
#[derive(clap::Parser, Resource, Clone, Debug)]
pub struct Args {
    /// Steps to run headless, 60 or as many as the script takes; a window runs until it is closed.
    #[arg(long, value_name = "N")]
    pub frames: Option<u32>,
    /// Size of the picture in pixels.
    #[arg(long, value_name = "WxH", default_value = "800x600", value_parser = parse_size)]
    pub size: UVec2,
    /// Draw headless and write frame-NNNN.png and report.json into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write only every N-th frame (the last is always written).
    #[arg(long, value_name = "N", default_value_t = 15)]
    pub every: u32,
    /// Seed of everything that is random.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Where the models' kernels run: gpu also moves the fluid of pools on a software GPU, cpu also means that nothing is drawn.
    /// Without it everything is drawn, and fluid moves on a GPU where there is a real one.
    #[arg(long, value_enum)]
    pub backend: Option<Backend>,
    /// Write the camera's path to this file; in the example training the whole run.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Follow the camera's path of this file; in the example training perform its run again.
    #[arg(long, value_name = "FILE")]
    pub replay: Option<PathBuf>,
    /// Hold the instrument with a device, for instance hand:mouse, hand:gamepad, haply, openhaptics, force_dimension, spacemouse or
    /// replay:FILE; a second one holds that of the left hand. `list` tells which there are.
    #[arg(long, value_name = "ID")]
    pub device: Vec<String>,
    /// An organ of your own: OBJ, STL, PLY, glTF or GLB; closed and without handles.
    #[arg(long, value_name = "PATH")]
    pub mesh: Option<PathBuf>,
    /// A volume of your own for the examples mastoid and deform: NRRD, NIfTI, MetaImage or DICOM, or a folder of DICOM, PNG or JPEG
    /// slices.
    #[arg(long, value_name = "PATH")]
    pub volume: Option<PathBuf>,
    /// A scene to begin with, in the example designer.
    #[arg(long, value_name = "FILE")]
    #[allow(dead_code, reason = "only the designer opens scenes")]
    pub scene: Option<PathBuf>,
    /// Distances between its voxels in millimetres, instead of what the file says.
    #[arg(long, value_name = "XxYxZ", value_parser = parse_spacing)]
    #[allow(dead_code, reason = "not every example shows a volume")]
    pub spacing: Option<Spacing>,
    /// Show the phantom in the example mastoid even where the real temporal bone is at hand.
    #[arg(long, conflicts_with = "volume")]
    #[allow(dead_code, reason = "not every example shows a volume")]
    pub phantom: bool,
    /// Show two pictures side by side in the example mastoid, one for each eye.
    #[arg(long)]
    #[allow(dead_code, reason = "not every example has a microscope")]
    pub stereo: bool,
    /// Open a second window in the example mastoid that shows what the microscope sees.
    #[arg(long)]
    #[allow(dead_code, reason = "not every example has a microscope")]
    pub monitor: bool,
    /// Draw a figure instead of frames. With the example mastoid, of the paper of 2009: 4, where fluid can be; 5, the meniscus; 7, the
    /// four ways of shading. With the example deform, of the paper of 2001: 7, the ways of finding normals.
    #[arg(long, value_name = "N", value_parser = parse_figure)]
    pub figure: Option<u32>,
    /// What the examples liver, mastoid and deform do by themselves.
    #[arg(long, value_enum, default_value_t = Script::None)]
    pub script: Script,
    /// Width of the reaction map of the example liver in texels, 64 to 8192.
    #[arg(long, value_name = "N", default_value_t = 1024)]
    #[allow(dead_code, reason = "not every example has reactions")]
    pub map: u32,
    /// Skin and size of the organ in the example liver: liver, gallbladder, spleen, kidney or mucosa.
    #[arg(long, value_name = "NAME", default_value = "liver")]
    #[allow(dead_code, reason = "not every example shows a single organ")]
    pub preset: OrganPreset,
    /// What the example training performs: bleeding-control, mastoidectomy, lesions, or a file that ends in .scenario.ron.
    #[arg(long, value_name = "X")]
    #[allow(dead_code, reason = "not every example performs scenarios")]
    pub scenario: Option<String>,
    /// Let a hand that can do it perform the example training.
    #[arg(long, conflicts_with = "novice")]
    #[allow(dead_code, reason = "not every example performs scenarios")]
    pub expert: bool,
    /// Let a hand that cannot do it perform the example training.
    #[arg(long)]
    #[allow(dead_code, reason = "not every example performs scenarios")]
    pub novice: bool,
    /// In the example training, leave the run of --replay after so many seconds, and go on with your own hand.
    #[arg(long, value_name = "SECONDS", requires = "replay")]
    #[allow(dead_code, reason = "not every example performs scenarios")]
    pub retry_at: Option<f64>,
}

impl Args {
    /// Steps to run headless.
    pub fn steps(&self) -> u32 {
        self.frames.unwrap_or(self.script.steps())
    }
}

fn parse_size(text: &str) -> Result<UVec2, String> {
    let (width, height) = text.split_once('x').ok_or("write it as 800x600")?;
    let side = |side: &str| match side.parse::<u32>() {
        Ok(px) if (16..=8192).contains(&px) => Ok(px),
        _ => Err(format!("{side} is no number of pixels between 16 and 8192")),
    };
    Ok(UVec2::new(side(width)?, side(height)?))
}

fn parse_figure(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(number @ (4 | 5 | 7)) => Ok(number),
        _ => Err("there are figures 4, 5 and 7".into()),
    }
}
