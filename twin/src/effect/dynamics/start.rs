//! Where a runtime begins: after a set-point that has been in force, or where another one is.

use super::Runtime;
use crate::command::WheelCommand;
use crate::model::Model;

impl Runtime {
    /// Fills what the stages remember as if this set-point had been in force for long: for starts in motion.
    pub(crate) fn prime(&mut self, command: &WheelCommand) {
        let mut command = *command;
        for stage in &self.dynamics.commands {
            stage.prime(&command, &mut self.memory);
            stage.apply(&mut command, &self.nominal, &mut self.memory, 0);
        }
    }

    /// True when a stage remembers set-points.
    pub(crate) fn remembers_commands(&self) -> bool {
        self.dynamics.commands.iter().any(|stage| stage.words() > 0)
    }

    /// Lets the stages see a set-point that was in force `to_go` physics steps before the first one; what comes out behind them.
    pub(crate) fn remember(&mut self, command: &WheelCommand, to_go: u64) -> WheelCommand {
        let mut command = *command;
        for stage in &self.dynamics.commands {
            stage.remember(&mut command, &self.nominal, &mut self.memory, to_go);
        }
        command
    }

    /// Takes over what a runtime of the same robot remembers; allocates only where motors have a controller of their own.
    pub(crate) fn copy_from(&mut self, other: &Runtime) {
        *self.live = Model::clone(&other.live);
        self.push = other.push;
        self.shift = other.shift;
        self.memory.clone_from(&other.memory);
        self.drives.clone_from(&other.drives);
        self.sent = other.sent;
        self.step = other.step;
    }
}
