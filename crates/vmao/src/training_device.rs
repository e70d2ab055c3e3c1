//! Where networks are trained: what was asked for, and what there is.

use crate::output::log;
use vmao_net::Device;

/// The option of commands that train.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct DeviceOptions {
    /// Where networks are trained; without a working CUDA device it is the CPU, which alone gives the same bits everywhere
    #[arg(long, value_enum, value_name = "DEVICE", default_value_t = DeviceChoice::Cpu)]
    pub device: DeviceChoice,
}

/// Where networks shall be trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum DeviceChoice {
    /// A CUDA device if there is one that works
    Auto,
    /// The processor: the same weights to the last bit on every run
    Cpu,
    /// The first CUDA device
    Cuda,
}

impl DeviceOptions {
    /// What trains. A line on stderr names a GPU that was found, or says why there is none.
    pub fn resolve(self) -> Device {
        if self.device == DeviceChoice::Cpu {
            return Device::Cpu;
        }
        match Device::cuda() {
            Ok(device) => {
                log("training on the first CUDA device");
                device
            }
            Err(reason) => {
                log(&format!("training on the CPU, as there is no CUDA device: {reason}"));
                Device::Cpu
            }
        }
    }
}
