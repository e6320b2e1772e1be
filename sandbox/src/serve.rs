//! The child's side: reads the setup, compiles the program, answers view after view.

use std::io::{BufRead, Read, Write};

use control::law::{Fault, FaultKind};
use controllers::answer::Answer;
use controllers::program::{Reply, compile};

use crate::message::{Ask, MAX_LINE_BYTES, Told};

/// Serves until the input ends or the program cannot go on.
///
/// - `confined`: layers in force, told to the parent.
/// - Errors: the pipe is broken or the parent says something that is no message.
pub fn serve(input: impl Read, mut output: impl Write, confined: Vec<String>) -> std::io::Result<()> {
    let mut input = std::io::BufReader::new(input);
    let Some(Ask::Setup { team: setup, source }) = ask(&mut input)? else {
        return Err(std::io::Error::other("the first message is not the setup"));
    };
    let robots = setup.robots.len();
    let source = source.ok_or_else(|| Fault::new(FaultKind::Refused, None, "the setup has no program"));
    let mut program = match source.and_then(|source| compile(&source, &setup)) {
        Ok(program) => program,
        Err(fault) => return tell(&mut output, &Told::Fault(fault)),
    };
    tell(&mut output, &Told::Ready { confined })?;
    let mut answer = Answer::default();
    while let Some(Ask::View(view)) = ask(&mut input)? {
        answer.clear(robots);
        match program.step(&view, &mut answer) {
            Ok(Reply::InTime | Reply::Late) => {}
            Err(fault) => return tell(&mut output, &Told::Fault(fault)),
        }
        let told = Told::Answer {
            tick: view.tick,
            answer: std::mem::take(&mut answer),
        };
        tell(&mut output, &told)?;
        if let Told::Answer { answer: used, .. } = told {
            answer = used;
        }
    }
    Ok(())
}

fn ask(input: &mut impl BufRead) -> std::io::Result<Option<Ask>> {
    let mut line = String::new();
    let read = input.by_ref().take(MAX_LINE_BYTES as u64).read_line(&mut line)?;
    if read == 0 {
        return Ok(None);
    }
    Ok(Some(serde_json::from_str(&line)?))
}

fn tell(output: &mut impl Write, told: &Told) -> std::io::Result<()> {
    let mut line = serde_json::to_vec(told)?;
    line.push(b'\n');
    output.write_all(&line)?;
    output.flush()
}
