//! Robot documents: a controller, its sensors and the robot description.

use serde::{Deserialize, Serialize};

use super::Pairing;
use super::controller::{CONTROLLERS, ControllerKind};
use super::sensor::{SENSORS, SensorKind};
use crate::parameter::ParameterError;
use crate::robot::RobotDescription;

/// Value of `format`.
pub const FORMAT: &str = "robopheus.robot/1";

/// `{"format":"robopheus.robot/1","controller":"sam3x","sensors":["encoder"],"robot":{...}}`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDocument {
    pub format: String,
    /// `mega2560`, `sam3x` or `tx2`.
    pub controller: String,
    /// Names of [`SENSORS`], each at most once.
    pub sensors: Vec<String>,
    pub robot: RobotDescription,
}

impl RobotDocument {
    /// The pair that this document describes; its budgets are not checked yet.
    ///
    /// - Errors: unknown or repeated names, and everything that is wrong with the description.
    pub fn pairing(&self) -> Result<Pairing, Vec<ParameterError>> {
        let mut problems = Vec::new();
        if self.format != FORMAT {
            let message = format!("{:?} is not a robot document", self.format);
            problems.push(problem(
                "format".to_owned(),
                message,
                FORMAT.to_owned(),
                "give this format",
            ));
        }
        let controller = ControllerKind::from_name(&self.controller);
        if controller.is_none() {
            let names = CONTROLLERS.map(|controller| controller.kind.name()).join(", ");
            let message = format!("the controller {:?} is not known", self.controller);
            problems.push(problem("controller".to_owned(), message, names, "choose one of these"));
        }
        let sensors = self.sensors(&mut problems);
        problems.extend(self.robot.check().into_iter().map(|error| ParameterError {
            field: format!("robot.{}", error.field),
            ..error
        }));
        match controller {
            Some(controller) if problems.is_empty() => Ok(Pairing {
                controller,
                sensors,
                robot: self.robot.clone(),
            }),
            _ => Err(problems),
        }
    }

    fn sensors(&self, problems: &mut Vec<ParameterError>) -> Vec<SensorKind> {
        let mut sensors = Vec::new();
        for (i, name) in self.sensors.iter().enumerate() {
            let field = format!("sensors[{i}]");
            match SensorKind::from_name(name) {
                None => {
                    let names = SENSORS.map(SensorKind::name).join(", ");
                    let message = format!("the sensor {name:?} is not known");
                    problems.push(problem(field, message, names, "choose one of these"));
                }
                Some(sensor) if sensors.contains(&sensor) => {
                    let message = format!("{name:?} is named twice");
                    problems.push(problem(field, message, "each sensor once".to_owned(), "name it once"));
                }
                Some(sensor) => sensors.push(sensor),
            }
        }
        sensors
    }
}

fn problem(field: String, message: String, limit: String, remedy: &str) -> ParameterError {
    ParameterError {
        field,
        message,
        limit,
        remedy: remedy.to_owned(),
    }
}
