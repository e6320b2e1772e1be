//! What a pair needs, item by item, against what the controller has.

use serde::Serialize;

use super::Pairing;
use super::connector::{self, Actuator};
use super::controller::{Controller, Ports};
use super::sensor::{Drive, SensorKind};
use super::task::{self, Task};

/// Something that can run out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Budget {
    ConnectorPins,
    PwmOutputs,
    EncoderInputs,
    AnalogInputs,
    SerialPorts,
    I2cBuses,
    Usb3Ports,
    /// Cycles per 480 Hz step.
    Compute,
    /// Bytes of RAM.
    Memory,
}

/// All budgets, in the order in which problems are reported.
pub const BUDGETS: [Budget; 9] = [
    Budget::ConnectorPins,
    Budget::PwmOutputs,
    Budget::EncoderInputs,
    Budget::AnalogInputs,
    Budget::SerialPorts,
    Budget::I2cBuses,
    Budget::Usb3Ports,
    Budget::Compute,
    Budget::Memory,
];

/// One consumer of a pair: its program's frame, the link, an actuator or a sensor.
#[derive(Debug, Clone)]
pub(super) struct Item {
    pub(super) name: String,
    /// Where it stands in the robot document.
    pub(super) field: String,
    pub(super) sensor: Option<SensorKind>,
    connector_pins: u64,
    ports: Ports,
    cycles_per_step: u64,
    ram_bytes: u64,
}

impl Budget {
    /// As in messages.
    pub fn unit(self) -> &'static str {
        match self {
            Budget::ConnectorPins => "connector pins for actuators",
            Budget::PwmOutputs => "PWM outputs",
            Budget::EncoderInputs => "encoder inputs",
            Budget::AnalogInputs => "analog inputs",
            Budget::SerialPorts => "serial ports",
            Budget::I2cBuses => "I2C buses",
            Budget::Usb3Ports => "USB 3 ports",
            Budget::Compute => "cycles per 480 Hz step",
            Budget::Memory => "bytes of RAM",
        }
    }

    /// One consumer leaves all of it to the next.
    fn is_shared(self) -> bool {
        self == Budget::I2cBuses
    }

    /// What `controller` has of it.
    pub fn available(self, controller: &Controller) -> u64 {
        match self {
            Budget::ConnectorPins => controller.actuator_pins.min(connector::ACTUATOR_PINS),
            Budget::Compute => controller.usable_cycles_per_step(),
            Budget::Memory => controller.ram_bytes,
            _ => self.of_ports(&controller.ports),
        }
    }

    /// What the whole pair needs of it.
    pub fn needed(self, pair: &Pairing) -> u64 {
        self.total(items(pair, pair.controller.controller()).iter())
    }

    /// What several items need of it together.
    pub(super) fn total<'a>(self, items: impl Iterator<Item = &'a Item>) -> u64 {
        items.map(|item| item.need(self)).fold(0, |total, need| {
            if self.is_shared() {
                total.max(need)
            } else {
                total.saturating_add(need)
            }
        })
    }

    fn of_ports(self, ports: &Ports) -> u64 {
        match self {
            Budget::PwmOutputs => ports.pwm_outputs,
            Budget::EncoderInputs => ports.encoder_inputs,
            Budget::AnalogInputs => ports.analog_inputs,
            Budget::SerialPorts => ports.serial_ports,
            Budget::I2cBuses => ports.i2c_buses,
            Budget::Usb3Ports => ports.usb3_ports,
            Budget::ConnectorPins | Budget::Compute | Budget::Memory => 0,
        }
    }
}

impl Item {
    pub(super) fn need(&self, budget: Budget) -> u64 {
        match budget {
            Budget::ConnectorPins => self.connector_pins,
            Budget::Compute => self.cycles_per_step,
            Budget::Memory => self.ram_bytes,
            _ => budget.of_ports(&self.ports),
        }
    }

    fn program(name: &str, tasks: &[Task], ram_bytes: u64, controller: &Controller) -> Item {
        Item {
            name: name.to_owned(),
            field: "controller".to_owned(),
            sensor: None,
            connector_pins: 0,
            ports: Ports::default(),
            cycles_per_step: task::cycles_per_step(tasks, controller),
            ram_bytes,
        }
    }

    fn actuator(actuator: Actuator, controller: &Controller) -> Item {
        let (field, task, ram_bytes, analog_inputs) = match actuator {
            Actuator::Motor { wheel } => (format!("robot.wheels[{wheel}]"), task::MOTOR, task::MOTOR_RAM_BYTES, 0),
            Actuator::SteeringGear => (
                "robot.steering".to_owned(),
                task::STEERING_GEAR,
                task::STEERING_GEAR_RAM_BYTES,
                1,
            ),
        };
        Item {
            field,
            connector_pins: actuator.pin_count(),
            ports: Ports {
                pwm_outputs: 1,
                analog_inputs,
                ..Ports::default()
            },
            ..Item::program(&actuator.name(), &[task], ram_bytes, controller)
        }
    }

    fn sensor(index: usize, sensor: SensorKind, drive: Drive, controller: &Controller) -> Item {
        let demand = sensor.demand(drive, controller);
        Item {
            field: format!("sensors[{index}]"),
            sensor: Some(sensor),
            ports: demand.ports,
            ..Item::program(sensor.name(), &demand.tasks, demand.ram_bytes, controller)
        }
    }
}

/// Everything that `controller` would have to serve in this pair.
pub(super) fn items(pair: &Pairing, controller: &Controller) -> Vec<Item> {
    let actuators = connector::actuators(&pair.robot);
    let motors = actuators
        .iter()
        .filter(|actuator| matches!(actuator, Actuator::Motor { .. }));
    let drive = Drive {
        motor_count: motors.count() as u64,
        motor: pair.robot.motor.as_ref(),
    };
    let step = Item::program("step", &[task::STEP], task::STEP_RAM_BYTES, controller);
    let mut link = Item::program("link", &task::link(controller), task::LINK_RAM_BYTES, controller);
    link.ports.serial_ports = 1;
    let mut items = vec![step, link];
    items.extend(
        actuators
            .into_iter()
            .map(|actuator| Item::actuator(actuator, controller)),
    );
    let sensors = pair.sensors.iter().enumerate();
    items.extend(sensors.map(|(index, &sensor)| Item::sensor(index, sensor, drive, controller)));
    items
}
