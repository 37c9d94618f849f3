//! Voices are rendered to buffers and measured; tools get theirs from what they do.

use bevy_surgery::sound::{
    CauteryDials, CauteryVoice, DialledVoice, DrillDials, DrillSound, DrillVoice, SuctionDials, SuctionVoice,
    ToolDials, ToolVoice, Voice, VoiceDials,
};
use bevy_surgery::tools::ToolWork;
use std::f64::consts::{PI, TAU};

#[path = "sound/tools.rs"]
mod tools;

const RATE_HZ: u32 = 48_000;
const SECOND: usize = RATE_HZ as usize;
const WINDOW: usize = 1 << 15;

/// Discrete Fourier transform in place, of a power of two.
fn fft(values: &mut [(f64, f64)]) {
    let count = values.len();
    if count < 2 {
        return;
    }
    let mut halves: [Vec<_>; 2] = [0, 1].map(|from| values.iter().skip(from).step_by(2).copied().collect());
    halves.iter_mut().for_each(|half| fft(half));
    for k in 0..count / 2 {
        let (sin, cos) = (-TAU * k as f64 / count as f64).sin_cos();
        let ((re, im), (odd_re, odd_im)) = (halves[0][k], halves[1][k]);
        let (odd_re, odd_im) = (odd_re * cos - odd_im * sin, odd_re * sin + odd_im * cos);
        (values[k], values[k + count / 2]) = ((re + odd_re, im + odd_im), (re - odd_re, im - odd_im));
    }
}

/// Power by frequency of the last [`WINDOW`] samples, with Hann's window.
struct Spectrum(Vec<f64>);

impl Spectrum {
    const BIN_HZ: f64 = RATE_HZ as f64 / WINDOW as f64;

    fn of(samples: &[f32]) -> Self {
        let samples = &samples[samples.len() - WINDOW..];
        let window = |n: usize| (PI * n as f64 / WINDOW as f64).sin().powi(2);
        let mut values: Vec<_> = samples.iter().enumerate().map(|(n, s)| (window(n) * f64::from(*s), 0.0)).collect();
        fft(&mut values);
        Self(values[..WINDOW / 2].iter().map(|(re, im)| (re * re + im * im) / WINDOW as f64).collect())
    }

    fn bins(&self, from_hz: f64, to_hz: f64) -> std::ops::Range<usize> {
        (from_hz / Self::BIN_HZ) as usize..((to_hz / Self::BIN_HZ) as usize).min(self.0.len())
    }

    /// Mean power in a band.
    fn power(&self, from_hz: f64, to_hz: f64) -> f64 {
        let bins = self.bins(from_hz, to_hz);
        self.0[bins.clone()].iter().sum::<f64>() / bins.len() as f64
    }

    /// Centre of the strongest tone in a band: the mean of what lies around the peak, since no motor holds its speed.
    fn tone_hz(&self, from_hz: f64, to_hz: f64) -> f64 {
        let peak = self.bins(from_hz, to_hz).max_by(|a, b| self.0[*a].total_cmp(&self.0[*b])).expect("a band");
        let near = peak - 8..peak + 9;
        let sum: f64 = self.0[near.clone()].iter().sum();
        near.map(|bin| bin as f64 * self.0[bin]).sum::<f64>() / sum * Self::BIN_HZ
    }
}

fn rms(samples: &[f32]) -> f64 {
    (samples.iter().map(|sample| f64::from(*sample).powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
}

/// A second of a voice, half a second after its dials were turned.
fn heard<V: Voice>(mut voice: V, dials: V::Dials) -> Vec<f32> {
    voice.turn(dials);
    voice.skip(SECOND / 2).take(SECOND).collect()
}

fn drilled(sound: DrillSound, dials: DrillDials) -> Vec<f32> {
    heard(DrillVoice::new(sound, RATE_HZ, 7), dials)
}

#[test]
fn the_tone_of_a_drill_rises_with_the_force() {
    let sound = DrillSound::default();
    for (force_n, expected_hz) in [(0.0, 500.0), (2.5, 550.0), (5.0, 600.0), (50.0, 650.0)] {
        assert!((sound.fundamental_hz(30_000.0, force_n) - expected_hz as f32).abs() < 0.01);
        let dials = DrillDials { speed_rpm: 30_000.0, force_n, contact: 0.5, hardness: 0.8 };
        let heard = Spectrum::of(&drilled(sound, dials)).tone_hz(300.0, 900.0);
        assert!((heard / expected_hz - 1.0_f64).abs() < 0.005, "{force_n} N: {heard} Hz");
    }
    let slowed = DrillSound { pitch_per_n: -0.05, ..sound };
    let dials = DrillDials { speed_rpm: 30_000.0, force_n: 4.0, ..Default::default() };
    let heard = Spectrum::of(&drilled(slowed, dials)).tone_hz(300.0, 900.0);
    assert!((heard / 400.0 - 1.0).abs() < 0.005, "{heard} Hz");
}

#[test]
fn a_drill_has_overtones_and_a_bearing() {
    let turning = DrillDials { speed_rpm: 40_000.0, ..Default::default() };
    let tone = 40_000.0 / 60.0;
    let worn = Spectrum::of(&drilled(DrillSound { bearing: 1.0, ..Default::default() }, turning));
    let new = Spectrum::of(&drilled(DrillSound { bearing: 0.0, ..Default::default() }, turning));
    let line = |spectrum: &Spectrum, hz: f64| spectrum.power(hz - 12.0, hz + 12.0);
    for n in 1..=8 {
        let between = line(&new, (f64::from(n) + 0.5) * tone);
        assert!(line(&new, f64::from(n) * tone) > 1000.0 * between, "overtone {n}");
    }
    // The cage swings the tone: lines on both sides of it.
    for side in [0.61, 1.39] {
        let beside = line(&worn, (side - 0.08) * tone).max(line(&worn, (side + 0.08) * tone));
        assert!(line(&worn, side * tone) > 30.0 * beside, "{side}");
    }
    let between = |spectrum: &Spectrum| spectrum.power(5.6 * tone, 5.9 * tone);
    assert!(between(&worn) > 100.0 * between(&new), "a worn bearing hisses");
}

#[test]
fn bone_rasps_by_contact_and_brighter_where_it_is_hard() {
    let with = |contact, hardness| {
        let dials = DrillDials { speed_rpm: 30_000.0, force_n: 1.0, contact, hardness };
        // Without a bearing, whose lines would lie between the overtones.
        Spectrum::of(&drilled(DrillSound { bearing: 0.0, ..Default::default() }, dials))
    };
    let [free, half, full] = [0.0, 0.5, 1.0].map(|contact| with(contact, 0.0).power(620.0, 960.0));
    assert!(half > 4.0 * free && full > 2.0 * half, "{free} {half} {full}");
    let bright = |hardness| {
        let spectrum = with(1.0, hardness);
        // Between the overtones, which do not know the bone.
        spectrum.power(7000.0, 11_000.0) / spectrum.power(560.0, 940.0)
    };
    let [soft, middle, hard] = [0.0, 0.5, 1.0].map(bright);
    assert!(middle > 3.0 * soft && hard > 2.0 * middle, "{soft} {middle} {hard}");
}

#[test]
fn overtones_do_not_come_back_as_other_tones() {
    // Overtones of 3333 Hz above the eighth would be folded; so would flutes that strike 26,667 times a second.
    let sound = DrillSound { gain: 0.2, bearing: 0.0, tones_per_turn: 2.5, ..Default::default() };
    let samples = drilled(sound, DrillDials { speed_rpm: 200_000.0, ..Default::default() });
    let spectrum = Spectrum::of(&samples);
    let tone = f64::from(sound.fundamental_hz(200_000.0, 0.0));
    assert!(tone > 8000.0, "{tone}");
    let line = |hz: f64| spectrum.power(hz - 100.0, hz + 100.0);
    for n in 3..=8 {
        let folded = (f64::from(n) * tone) % f64::from(RATE_HZ);
        let folded = folded.min(f64::from(RATE_HZ) - folded);
        if (folded - tone).abs() > 500.0 && (folded - 2.0 * tone).abs() > 500.0 && folded > 500.0 {
            assert!(line(tone) > 1e5 * line(folded), "overtone {n} of {tone} Hz at {folded} Hz");
        }
    }
}

/// Strongest second difference: a click stands out in it.
fn roughest(samples: &[f32]) -> f32 {
    samples.windows(3).map(|s| (s[0] - 2.0 * s[1] + s[2]).abs()).fold(0.0, f32::max)
}

/// Turns from each to each, and looks whether the first millisecond is any rougher than what was before and what may come.
fn no_jump_clicks<V: Voice>(voice: V, all: &[V::Dials]) {
    let rest = |dials: &V::Dials| roughest(&heard(voice.clone(), *dials));
    let most = all.iter().map(rest).fold(0.0, f32::max);
    for (from, to) in (0..all.len()).flat_map(|from| (0..all.len()).map(move |to| (from, to))) {
        let mut voice = voice.clone();
        voice.turn(all[from]);
        let before: Vec<f32> = voice.by_ref().take(SECOND / 2).collect();
        let before = &before[SECOND / 4..];
        voice.turn(all[to]);
        let after: Vec<f32> = voice.take(48).collect();
        // The seam belongs to it.
        let jump = [&before[before.len() - 2..], &after].concat();
        let allowed = 1.2 * roughest(before) + 0.1 * most;
        assert!(roughest(&jump) <= allowed, "{from} to {to}: {} of {allowed}", roughest(&jump));
    }
}

#[test]
fn dials_that_jump_make_no_click() {
    let drill = |speed_rpm, force_n, contact, hardness| DrillDials { speed_rpm, force_n, contact, hardness };
    let states = [
        drill(0.0, 0.0, 0.0, 0.0),
        drill(40_000.0, 0.0, 0.0, 0.0),
        drill(40_000.0, 0.0, 0.0, 1.0),
        drill(40_000.0, 8.0, 1.0, 1.0),
        drill(20_000.0, 2.0, 0.5, 0.0),
    ];
    no_jump_clicks(DrillVoice::new(DrillSound::default(), RATE_HZ, 3), &states);
    // A motor alone is smooth, so that even a faint click would show.
    no_jump_clicks(DrillVoice::new(DrillSound { bearing: 0.0, ..Default::default() }, RATE_HZ, 3), &states[..2]);
    let suck = |strength, liquid| SuctionDials { strength, liquid };
    no_jump_clicks(SuctionVoice::new(RATE_HZ, 3), &[suck(0.0, 0.0), suck(1.0, 0.0), suck(1.0, 0.5), suck(1.0, 1.0)]);
    let burn = |heat, water| CauteryDials { heat, water };
    no_jump_clicks(CauteryVoice::new(RATE_HZ, 3), &[burn(0.0, 0.0), burn(0.0, 1.0), burn(1.0, 1.0)]);
    let works = [
        ToolWork::Idle,
        ToolWork::Drilling { speed_rpm: 40_000.0, force_n: 4.0, contact: 1.0, hardness: 1.0 },
        ToolWork::Sucking { strength: 1.0, liquid: 0.0 },
    ];
    let tool = |work, gain| ToolDials { work, drill: DrillSound::default(), gain };
    no_jump_clicks(ToolVoice::new(RATE_HZ, 3), &works.map(|work| tool(work, 1.0)));
    no_jump_clicks(ToolVoice::new(RATE_HZ, 3), &[tool(works[1], 1.0), tool(works[1], 0.0), tool(works[1], 0.3)]);
}

/// How much the loudness of a band swings: deviation over mean of its power in pieces of 5 ms.
fn swing(samples: &[f32]) -> f64 {
    // The first difference leaves what is high.
    let high: Vec<f32> = samples.windows(2).map(|s| s[1] - s[0]).collect();
    let powers: Vec<f64> = high.chunks_exact(240).map(|piece| rms(piece).powi(2)).collect();
    let mean = powers.iter().sum::<f64>() / powers.len() as f64;
    (powers.iter().map(|power| (power - mean).powi(2)).sum::<f64>() / powers.len() as f64).sqrt() / mean
}

#[test]
fn suction_gurgles_where_it_draws_air_and_liquid() {
    let draw = |strength, liquid| heard(SuctionVoice::new(RATE_HZ, 5), SuctionDials { strength, liquid });
    assert!(draw(0.0, 0.5).iter().all(|sample| *sample == 0.0), "off is silent");
    let samples = [0.0, 0.5, 1.0].map(|liquid| draw(1.0, liquid));
    let [air, both, liquid] = [0, 1, 2].map(|n: usize| Spectrum::of(&samples[n]));
    assert!(air.power(2500.0, 6000.0) > 20.0 * liquid.power(2500.0, 6000.0), "air hisses");
    assert!(liquid.power(150.0, 450.0) > 10.0 * air.power(150.0, 450.0), "liquid is dark");
    // Bubbles ring where neither air nor liquid is loud, and the hiss comes in slugs.
    let bubbles = |spectrum: &Spectrum| spectrum.power(380.0, 750.0);
    assert!(bubbles(&both) > 1.5 * bubbles(&air).max(bubbles(&liquid)), "both gurgle");
    let [air, both, liquid] = [0, 1, 2].map(|n: usize| swing(&samples[n]));
    assert!(both > 5.0 * air && both > 2.0 * liquid, "{air} {both} {liquid}");
    assert!(rms(&draw(0.5, 0.0)) < 0.6 * rms(&draw(1.0, 0.0)));
}

/// Peak over mean: how much something crackles.
fn crest(samples: &[f32]) -> f64 {
    samples.iter().map(|sample| f64::from(sample.abs())).fold(0.0, f64::max) / rms(samples)
}

#[test]
fn cautery_sizzles_by_heat_and_water() {
    let burn = |heat, water| heard(CauteryVoice::new(RATE_HZ, 5), CauteryDials { heat, water });
    assert!(burn(0.0, 1.0).iter().all(|sample| *sample == 0.0));
    let [cool, hot, half, dry] = [burn(0.4, 1.0), burn(1.0, 1.0), burn(1.0, 0.5), burn(1.0, 0.0)];
    assert!(rms(&hot) > 1.8 * rms(&cool));
    assert!(rms(&hot) > 1.15 * rms(&half) && rms(&half) > 1.3 * rms(&dry));
    let bright = |samples: &[f32]| {
        let spectrum = Spectrum::of(samples);
        spectrum.power(2000.0, 9000.0) / spectrum.power(50.0, 500.0)
    };
    assert!(bright(&hot) > 4.0, "it hisses rather than hums: {}", bright(&hot));
    // Steady noise of one second has a crest of less than five.
    assert!(crest(&hot) > 6.0, "{}", crest(&hot));
}

#[test]
fn voices_are_bounded_deterministic_and_take_nonsense() {
    fn play<V: Voice>(make: impl Fn() -> V, nonsense: impl Fn(f32) -> V::Dials) {
        let run = || -> Vec<f32> {
            let mut voice = make();
            [f32::NAN, f32::INFINITY, -1e30, 1e30, f32::MAX, 5.0, f32::NEG_INFINITY]
                .into_iter()
                .flat_map(|value| {
                    voice.turn(nonsense(value));
                    voice.by_ref().take(4800).collect::<Vec<_>>()
                })
                .collect()
        };
        let samples = run();
        assert!(samples.iter().all(|sample| sample.is_finite() && sample.abs() <= 1.0));
        assert_eq!(samples, run());
    }
    let drill = |x| DrillDials { speed_rpm: x, force_n: x, contact: x, hardness: x };
    let built = |x| DrillSound { tones_per_turn: x, pitch_per_n: x, most_pitch: x, flutes: x, bearing: x, gain: x };
    play(|| DrillVoice::new(DrillSound::default(), RATE_HZ, 11), drill);
    play(|| DrillVoice::new(built(f32::NAN), 0, 11), drill);
    play(|| DrillVoice::new(built(1e30), u32::MAX, 11), drill);
    play(|| SuctionVoice::new(RATE_HZ, 11), |x| SuctionDials { strength: x, liquid: x });
    play(|| CauteryVoice::new(RATE_HZ, 11), |x| CauteryDials { heat: x, water: x });
    let work = |x| ToolWork::Drilling { speed_rpm: x, force_n: x, contact: x, hardness: x };
    play(|| ToolVoice::new(RATE_HZ, 11), |x| ToolDials { work: work(x), drill: built(x), gain: x });
}

#[test]
fn voices_hear_dials_turned_elsewhere() {
    let dials = VoiceDials::default();
    let sizzling = CauteryDials { heat: 1.0, water: 1.0 };
    dials.turn(sizzling);
    let voice = || CauteryVoice::new(RATE_HZ, 1);
    let (mut first, mut second) = (DialledVoice::new(voice(), &dials), DialledVoice::new(voice(), &dials));
    let play = |voice: &mut DialledVoice<CauteryVoice>| rms(&voice.by_ref().take(SECOND / 2).collect::<Vec<_>>());
    assert!(play(&mut first) > 0.02, "it begins with the dials as they are");
    assert_eq!((dials.voices(), dials.read()), (2, sizzling));
    let turner = dials.clone();
    std::thread::spawn(move || turner.turn(CauteryDials::default())).join().expect("it turns");
    play(&mut first);
    assert_eq!(play(&mut first), 0.0);
    play(&mut second);
    assert_eq!(play(&mut second), 0.0);
    drop(first);
    assert_eq!(dials.voices(), 1);
}
