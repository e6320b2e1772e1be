//! Every robot drives to its first target: a WebAssembly module in Rust. Layout of views and commands: `docs/controllers.md`.
//!
//! Build: `rustc --target wasm32-unknown-unknown --edition 2024 -O -C panic=abort -C strip=symbols --crate-type cdylib -o go_to_point.wasm go_to_point.rs`

const ROBOT_WORDS: usize = 24;
const ORDER_WORDS: usize = 16;

#[link(wasm_import_module = "robopheus")]
unsafe extern "C" {
    safe fn hypot(x: f64, y: f64) -> f64;
    fn log(text: *const u8, length: usize);
}

static mut COMMANDS: [f64; 50 * ORDER_WORDS] = [0.0; 50 * ORDER_WORDS];

#[unsafe(no_mangle)]
pub extern "C" fn buffer(words: usize) -> *mut f64 {
    Vec::leak(vec![0.0; words]).as_mut_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn step(view: *const f64, words: usize) -> *const f64 {
    // SAFETY: the host passes the buffer that it got, and nothing else runs meanwhile.
    let (view, commands) = unsafe { (std::slice::from_raw_parts(view, words), &mut *(&raw mut COMMANDS)) };
    if view[1] == 0.0 {
        let text = "going to my point";
        // SAFETY: pointer and length are those of a text.
        unsafe { log(text.as_ptr(), text.len()) };
    }
    let (robots, targets) = (&view[view[8] as usize..], &view[view[10] as usize..]);
    for (robot, command) in robots.chunks_exact(ROBOT_WORDS).zip(commands.chunks_exact_mut(ORDER_WORDS)).take(view[3] as usize) {
        command.fill(0.0);
        command[0] = 1.0;
        command[10] = 1.0;
        if robot[11] == 0.0 {
            continue;
        }
        let goal = &targets[3 * robot[12] as usize..];
        let (dx, dy) = (goal[0] - robot[0], goal[1] - robot[1]);
        let distance = hypot(dx, dy);
        command[11..14].copy_from_slice(&[1.0, goal[0], goal[1]]);
        if distance > 0.04 {
            let scale = (1.5 * distance).min(0.4) / distance;
            command[..4].copy_from_slice(&[2.0, scale * dx, scale * dy, f64::NAN]);
            command[10] = 0.0;
        }
    }
    commands.as_ptr()
}
