//! `--tev HOST:PORT`: the picture of a render while it goes on, in the image viewer tev, as linear
//! sRGB (its own controls set the exposure). A viewer that goes away is no reason to stop.

use super::{CliError, tell};
use crate::render::Render;
use crate::spectrum::xyz::xyz_to_linear_srgb;
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

const CHANNELS: [&str; 3] = ["R", "G", "B"];
/// Pixels of a message, as far as whole rows go.
const PIXELS: u32 = 1 << 20;
/// Pictures are sent no more often than this, and for no more than a twentieth of the time.
const INTERVAL: Duration = Duration::from_millis(500);
const TIMES_A_PICTURE: u32 = 20;
/// Time for the viewer to answer, and to take a message.
const PATIENCE: Duration = Duration::from_secs(5);

/// A viewer.
pub struct Viewer {
    /// `None` once it is gone.
    client: Option<TevClient>,
    /// Name of the picture.
    name: String,
    next: Instant,
    /// Whether it has the picture.
    begun: bool,
}

impl Viewer {
    /// Connects to the viewer at `address`, `HOST:PORT`.
    ///
    /// # Errors
    /// Nobody answers there.
    pub fn connect(address: &str, sensor: &str) -> Result<Self, CliError> {
        let failed = |e: io::Error| CliError::Failed(format!("tev at {address}: {e}"));
        let mut last = io::Error::new(io::ErrorKind::NotFound, "there is no such host");
        for place in address.to_socket_addrs().map_err(failed)? {
            match TcpStream::connect_timeout(&place, PATIENCE) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(PATIENCE)).map_err(failed)?;
                    return Ok(Self {
                        client: Some(TevClient::wrap(stream)),
                        // names end at the first zero
                        name: format!("abbe: {sensor}").replace('\0', ""),
                        next: Instant::now(),
                        begun: false,
                    });
                }
                Err(error) => last = error,
            }
        }
        Err(failed(last))
    }

    /// Shows the render, unless it was shown a moment ago and this is not the `last` time.
    pub fn show(&mut self, render: &Render, last: bool) {
        let began = Instant::now();
        let Some(client) = &mut self.client else {
            return;
        };
        if !last && began < self.next || render.passes().is_empty() {
            return;
        }
        let is_new = !std::mem::replace(&mut self.begun, true);
        if let Err(error) = send(client, &self.name, render, is_new) {
            tell(&format!(
                "warning: tev is gone: {error}; the render goes on"
            ));
            self.client = None;
        }
        self.next = Instant::now() + INTERVAL.max(TIMES_A_PICTURE * began.elapsed());
    }
}

fn send(client: &mut TevClient, name: &str, render: &Render, is_new: bool) -> io::Result<()> {
    let crop = render.crop();
    let (width, height) = (crop.width(), crop.height());
    if is_new {
        client.send(PacketCreateImage {
            image_name: name,
            grab_focus: true,
            width,
            height,
            channel_names: &CHANNELS,
        })?;
    }
    let xyz = render.xyz();
    let (pixels, _) = xyz.as_chunks::<3>();
    let rows = (PIXELS / width).max(1);
    for (i, strip) in pixels.chunks((rows * width) as usize).enumerate() {
        let rgb = strip.iter().flat_map(|xyz| xyz_to_linear_srgb(*xyz));
        let data: Vec<f32> = rgb.map(|v| v as f32).collect();
        client.send(PacketUpdateImage {
            image_name: name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2],
            channel_strides: &[3; 3],
            x: 0,
            y: i as u32 * rows,
            width,
            height: strip.len() as u32 / width,
            data: &data,
        })?;
    }
    Ok(())
}
