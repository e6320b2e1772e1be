//! Reading a scenario, with the path of the field where reading stopped.

use super::{FieldProblem, MAX_TEXT_BYTES, Scenario};

pub fn parse(text: &str) -> Result<Scenario, FieldProblem> {
    if text.len() > MAX_TEXT_BYTES {
        return Err(FieldProblem {
            field: String::new(),
            message: format!("the text has {} bytes", text.len()),
            limit: format!("at most {MAX_TEXT_BYTES} bytes"),
            remedy: "split the experiment into several".into(),
        });
    }
    serde_json::from_str(text).map_err(|error| problem(text, &error))
}

fn problem(text: &str, error: &serde_json::Error) -> FieldProblem {
    let syntax = error.is_syntax() || error.is_eof();
    let mut path = path_at(text, error.line(), error.column());
    let message = error.to_string();
    if let Some(name) = message
        .strip_prefix("missing field `")
        .and_then(|rest| rest.split('`').next())
    {
        join(&mut path, name);
    }
    FieldProblem {
        field: in_experiment(&path),
        message: if syntax {
            format!("not valid JSON: {message}")
        } else {
            message.clone()
        },
        limit: expected(&message),
        remedy: if syntax {
            format!("correct the text at line {}, column {}", error.line(), error.column())
        } else {
            format!(
                "correct the field at line {}, column {}; examples/experiments shows complete ones",
                error.line(),
                error.column()
            )
        },
    }
}

/// Paths are those of the experiment document; the rest of a scenario comes from the laboratory.
fn in_experiment(path: &str) -> String {
    match path.strip_prefix("experiment.") {
        Some(inner) => inner.to_owned(),
        None if path.starts_with("robots") => format!("laboratory.{path}"),
        None => path.to_owned(),
    }
}

/// What serde says it wanted, without the position.
fn expected(message: &str) -> String {
    let wanted = message
        .find("expected ")
        .map_or("a complete document of the form robopheus.experiment/1", |at| {
            &message[at..]
        });
    wanted.split(" at line ").next().unwrap_or(wanted).to_owned()
}

fn join(path: &mut String, name: &str) {
    if !path.is_empty() {
        path.push('.');
    }
    path.push_str(name);
}

/// A container that is open at the place of interest.
enum Open {
    Object(Option<String>),
    Array(usize),
}

/// Path of the value at a 1-based line and byte column of a JSON text that may be broken after that place.
fn path_at(text: &str, line: usize, column: usize) -> String {
    let before: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum();
    let end = before.saturating_add(column.saturating_sub(1)).min(text.len());
    let mut open: Vec<Open> = Vec::new();
    let mut bytes = text.bytes().enumerate().peekable();
    let mut string: Option<String> = None;
    let mut is_key = false;
    while let Some((at, byte)) = bytes.next() {
        if let Some(content) = &mut string {
            match byte {
                b'"' => {
                    let content = string.take();
                    if let (true, Some(Open::Object(key))) = (is_key, open.last_mut()) {
                        *key = content;
                        is_key = false;
                    }
                }
                b'\\' => {
                    bytes.next();
                }
                _ => content.push(byte as char),
            }
            if at >= end {
                break;
            }
            continue;
        }
        if at > end || (at == end && matches!(byte, b'}' | b']')) {
            if at == end {
                forget_last(&mut open);
            }
            break;
        }
        match byte {
            b'"' => string = Some(String::new()),
            b'{' => {
                open.push(Open::Object(None));
                is_key = true;
            }
            b'[' => {
                open.push(Open::Array(0));
                is_key = false;
            }
            b'}' | b']' => {
                open.pop();
                is_key = false;
            }
            b',' => match open.last_mut() {
                Some(Open::Object(_)) => is_key = true,
                Some(Open::Array(index)) => *index += 1,
                None => {}
            },
            _ => {}
        }
    }
    render(&open)
}

/// At the closing bracket the problem is the container, not its last entry.
fn forget_last(open: &mut Vec<Open>) {
    match open.last_mut() {
        Some(Open::Object(key)) => *key = None,
        Some(Open::Array(_)) => {
            open.pop();
        }
        None => {}
    }
}

fn render(open: &[Open]) -> String {
    let mut path = String::new();
    for container in open {
        match container {
            Open::Object(Some(key)) => join(&mut path, key),
            Open::Object(None) => {}
            Open::Array(index) => path.push_str(&format!("[{index}]")),
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_leads_to_the_place() {
        let text = "{\"a\": {\"b\": [1, {\"c\": x}]}}";
        let column = text.find('x').map_or(0, |at| at + 1);
        assert_eq!(path_at(text, 1, column), "a.b[1].c");
        assert_eq!(path_at("{\n \"a\": [\n  1,\n  nope]}", 4, 3), "a[1]");
    }
}
