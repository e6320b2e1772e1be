;; Every robot drives to its first target. Layout of views and commands: docs/controllers.md.
;; Build: wat2wasm go_to_point.wat -o go_to_point.wasm
(module
  (import "robopheus" "hypot" (func $hypot (param f64 f64) (result f64)))
  (memory (export "memory") 2)
  ;; Views at 4096, commands at 0: 16 words for each of at most 32 robots.
  (func (export "buffer") (param $words i32) (result i32)
    i32.const 4096)
  (func (export "step") (param $view i32) (param $words i32) (result i32)
    (local $robot i32) (local $at i32) (local $out i32) (local $goal i32)
    (local $left i32) (local $dx f64) (local $dy f64) (local $distance f64) (local $scale f64)
    (local.set $left (i32.trunc_sat_f64_s (f64.load offset=24 (local.get $view))))
    ;; Word 8 says where the robots begin.
    (local.set $at (i32.add (local.get $view)
      (i32.mul (i32.const 8) (i32.trunc_sat_f64_s (f64.load offset=64 (local.get $view))))))
    (block $done
      (loop $next
        (br_if $done (i32.eqz (local.get $left)))
        (local.set $left (i32.sub (local.get $left) (i32.const 1)))
        (f64.store (local.get $out) (f64.const 1)) ;; a twist
        (f64.store offset=8 (local.get $out) (f64.const 0))
        (f64.store offset=16 (local.get $out) (f64.const 0))
        (f64.store offset=24 (local.get $out) (f64.const 0))
        (f64.store offset=80 (local.get $out) (f64.const 1)) ;; finished, unless there is a way to go
        (if (f64.gt (f64.load offset=88 (local.get $at)) (f64.const 0))
          (then
            ;; Word 10 says where the targets begin, word 12 of a robot which is its first.
            (local.set $goal (i32.add (local.get $view) (i32.mul (i32.const 8) (i32.trunc_sat_f64_s
              (f64.add (f64.load offset=80 (local.get $view))
                (f64.mul (f64.const 3) (f64.load offset=96 (local.get $at))))))))
            (local.set $dx (f64.sub (f64.load (local.get $goal)) (f64.load (local.get $at))))
            (local.set $dy (f64.sub (f64.load offset=8 (local.get $goal)) (f64.load offset=8 (local.get $at))))
            (local.set $distance (call $hypot (local.get $dx) (local.get $dy)))
            (f64.store offset=88 (local.get $out) (f64.const 1)) ;; show the target
            (f64.store offset=96 (local.get $out) (f64.load (local.get $goal)))
            (f64.store offset=104 (local.get $out) (f64.load offset=8 (local.get $goal)))
            (if (f64.gt (local.get $distance) (f64.const 0.04))
              (then
                (local.set $scale (f64.div
                  (f64.min (f64.const 0.4) (f64.mul (f64.const 1.5) (local.get $distance)))
                  (local.get $distance)))
                (f64.store (local.get $out) (f64.const 2)) ;; a velocity
                (f64.store offset=8 (local.get $out) (f64.mul (local.get $scale) (local.get $dx)))
                (f64.store offset=16 (local.get $out) (f64.mul (local.get $scale) (local.get $dy)))
                (f64.store offset=24 (local.get $out) (f64.const nan)) ;; any yaw
                (f64.store offset=80 (local.get $out) (f64.const 0))))))
        (local.set $at (i32.add (local.get $at) (i32.const 192)))
        (local.set $out (i32.add (local.get $out) (i32.const 128)))
        (br $next)))
    i32.const 0))
