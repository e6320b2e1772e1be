//! Settings of the process: flags, each of which may stand in the environment.

use crate::robot_addresses::{OwnPlace, Place};
use clap::Parser;
use robot::medium::MediumKind;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Control server of a robot laboratory: takes runs from the service and drives them at 120 Hz.
#[derive(Debug, Clone, Parser)]
#[command(name = "robopheus-lab", version)]
pub struct Config {
    /// Address of the service.
    #[arg(long, env = "ROBOPHEUS_SERVER", default_value = "http://127.0.0.1:8080")]
    pub server: String,
    /// File with the bearer token of the role `lab`.
    #[arg(long, env = "ROBOPHEUS_LAB_TOKEN_FILE")]
    pub token_file: PathBuf,
    /// Description of the laboratory, `robopheus.lab/1`.
    #[arg(long, env = "ROBOPHEUS_LAB")]
    pub lab: PathBuf,
    /// Docks of robots, `robopheus.docks/1`: robots of a finished run drive home. Without, they stay where they stopped.
    #[arg(long, env = "ROBOPHEUS_DOCKS")]
    pub docks: Option<PathBuf>,
    /// Keys of the robot link by robot number.
    #[arg(long, env = "ROBOPHEUS_KEYS")]
    pub keys: PathBuf,
    /// Folder for everything that must survive a restart.
    #[arg(long, env = "ROBOPHEUS_DATA")]
    pub data: PathBuf,
    /// Robot `n` listens on this UDP port + n.
    #[arg(long, env = "ROBOPHEUS_ROBOT_UDP_BASE", default_value_t = 9000)]
    pub robot_udp_base: u16,
    /// Host of the robots that have no address of their own.
    #[arg(long, env = "ROBOPHEUS_ROBOT_HOST", default_value = "127.0.0.1")]
    pub robot_host: String,
    /// Address of one robot, `NUMBER=HOST` or `NUMBER=HOST:PORT`; once for each robot with a host of its own.
    #[arg(
        long,
        env = "ROBOPHEUS_ROBOT_ADDRESSES",
        value_delimiter = ',',
        value_name = "NUMBER=HOST[:PORT]"
    )]
    pub robot_address: Vec<OwnPlace>,
    /// Where frames for several robots go, most often a broadcast address; port: the base, unless given. Without it every
    /// robot gets frames of its own.
    #[arg(long, env = "ROBOPHEUS_ROBOT_BROADCAST", value_name = "HOST[:PORT]")]
    pub robot_broadcast: Option<Place>,
    /// What carries the frames: ideal, wifi, wifi-bursty, digimesh or serial. Runs that it cannot carry are refused.
    #[arg(long, env = "ROBOPHEUS_MEDIUM", default_value = "wifi", value_parser = crate::medium::named)]
    pub medium: MediumKind,
    /// Socket of a camera's process (`robopheus-camera serve --poses`); once for each camera, in the order of their numbers.
    #[arg(long, env = "ROBOPHEUS_CAMERAS", value_delimiter = ',')]
    pub camera: Vec<PathBuf>,
    /// Socket of a tracker that tells poses itself, instead of cameras.
    #[arg(long, env = "ROBOPHEUS_TRACKER")]
    pub tracker: Option<PathBuf>,
    /// Socket of the hand that puts robots on the floor (`docs/hand.md`); without it people do so by themselves.
    #[arg(long, env = "ROBOPHEUS_HAND")]
    pub hand: Option<PathBuf>,
    /// Address of the hub that other servers of this machine follow runs on; port 0 takes any, the real one stands in
    /// `<data>/lab-hub.addr`.
    #[arg(long, env = "ROBOPHEUS_HUB_LISTEN", default_value = "127.0.0.1:0")]
    pub hub_listen: SocketAddr,
    /// Address of the stop port; port 0 takes any, the real one stands in `<data>/lab-stop.addr`.
    #[arg(long, env = "ROBOPHEUS_STOP_LISTEN", default_value = "127.0.0.1:8081")]
    pub stop_listen: SocketAddr,
}
