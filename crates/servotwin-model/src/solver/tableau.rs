//! Coefficients of the Rosenbrock methods.
//!
//! The methods are written without matrix products. With `W = I/(γh) − J`,
//!
//! ```text
//! W U_i = f(t + α_i h, y + Σ_j a_ij U_j) + Σ_j (c_ij/h) U_j + h γ_i ∂f/∂t    (R1)
//! y_1   = y + Σ_j a_sj U_j + U_s,     error = U_s                           (R2)
//! y(θ)  = (1−θ) y + θ (y_1 + (1−θ)(k_1 + θ(k_2 + θ k_3))),  k_m = Σ_j h_mj U_j  (R3)
//! ```
//!
//! All methods are L-stable and stiffly accurate (the last stage is the error).

use crate::scalar::Scalar;

/// A Rosenbrock method.
#[derive(Clone, Copy, Debug)]
pub struct Tableau {
    /// `γ`.
    pub gamma: f64,
    /// `a_ij`, row by row below the diagonal.
    pub(crate) a: &'static [&'static [f64]],
    /// `c_ij`, row by row below the diagonal.
    pub(crate) c: &'static [&'static [f64]],
    /// `α_i`.
    pub alpha: &'static [f64],
    /// `γ_i`.
    pub gamma_sum: &'static [f64],
    /// `h_mj`; empty if the method has no dense output.
    pub(crate) dense: &'static [&'static [f64]],
    /// Order of the result; the error estimate is one order lower.
    pub order: u32,
}

impl Tableau {
    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.a.len()
    }

    /// Whether a stage's argument is the previous stage's argument plus its `U`, as in the last stages of stiffly
    /// accurate methods.
    #[inline(always)]
    fn continues(&self, stage: usize) -> bool {
        match self.a[stage].split_last() {
            Some((&last, others)) => last == 1.0 && others == self.a[stage - 1],
            None => false,
        }
    }

    /// Computes the argument of a stage, `states = y + Σ a_j U_j`, and the rest of its right-hand side,
    /// `right = (Σ c_j U_j)/h`. On entry `states` holds the argument of the previous stage.
    #[inline(always)]
    pub(crate) fn sum_stages<V: Scalar<Base = V>>(
        &self,
        stage: usize,
        states: &mut [V],
        y: &[V],
        right: &mut [V],
        reciprocal: V,
        stages: &[V],
    ) {
        let sums = StageSums { states, y, right, stages };
        let (a, c) = (self.a[stage], self.c[stage]);
        match (stage, self.continues(stage)) {
            (1, _) => sums.of::<1, false>(a, c, reciprocal),
            (2, false) => sums.of::<2, false>(a, c, reciprocal),
            (3, false) => sums.of::<3, false>(a, c, reciprocal),
            (4, false) => sums.of::<4, false>(a, c, reciprocal),
            (5, false) => sums.of::<5, false>(a, c, reciprocal),
            (3, true) => sums.of::<3, true>(a, c, reciprocal),
            (5, true) => sums.of::<5, true>(a, c, reciprocal),
            (6, true) => sums.of::<6, true>(a, c, reciprocal),
            (7, true) => sums.of::<7, true>(a, c, reciprocal),
            _ => unreachable!("no method has such stages"),
        }
    }
}

/// The inputs and outputs of a stage's sums.
struct StageSums<'a, V> {
    states: &'a mut [V],
    y: &'a [V],
    right: &'a mut [V],
    stages: &'a [V],
}

impl<V: Scalar<Base = V>> StageSums<'_, V> {
    /// Computes both sums in one pass over the stages. The number of stages is a constant, so
    /// that sums and weights stay in registers.
    #[inline(always)]
    fn of<const N: usize, const CONTINUES: bool>(self, a: &[f64], c: &[f64], factor: V) {
        let Self { states, y, right, stages } = self;
        let n = y.len();
        assert!(states.len() == n && right.len() == n && stages.len() >= N * n);
        let mut of_states = [V::constant(0.0); N];
        let mut of_right = [V::constant(0.0); N];
        for j in 0..N {
            of_states[j] = V::constant(a[j]);
            of_right[j] = V::constant(c[j]) * factor;
        }
        for (k, ((state, right), &y)) in states.iter_mut().zip(right).zip(y).enumerate() {
            let mut argument = if CONTINUES { *state } else { y };
            let mut sum = V::constant(0.0);
            for j in 0..N {
                // SAFETY: j < N and k < n; the length is asserted above.
                let stage = unsafe { *stages.get_unchecked(j * n + k) };
                match CONTINUES {
                    false => argument = argument + stage * of_states[j],
                    true if j == N - 1 => argument = argument + stage,
                    true => {}
                }
                sum = if j == 0 { stage * of_right[j] } else { sum + stage * of_right[j] };
            }
            *state = argument;
            *right = sum;
        }
    }
}

/// Four stages, order 3(2): Sandu, Verwer, Blom, Spee, Carmichael, Potra,
/// Atmospheric Environment 31 (1997) 3459. Three function evaluations.
pub(crate) static RODAS3: Tableau = Tableau {
    gamma: 0.5,
    a: &[&[], &[0.0], &[2.0, 0.0], &[2.0, 0.0, 1.0]],
    c: &[&[], &[4.0], &[1.0, -1.0], &[1.0, -1.0, -8.0 / 3.0]],
    alpha: &[0.0, 0.0, 1.0, 1.0],
    gamma_sum: &[0.5, 1.5, 0.0, 0.0],
    dense: &[],
    order: 3,
};

/// Six stages, order 4(3), with little order reduction for stiff problems: Steinebach,
/// Progress in Differential-Algebraic Equations II, Springer (2020) 165.
pub(crate) static RODAS4P2: Tableau = Tableau {
    gamma: 0.25,
    a: &[
        &[],
        &[3.0],
        &[0.906377755268814, -0.189707390391685],
        &[3.758617027739064, 1.161741776019525, -0.849258085312803],
        &[7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775],
        &[7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775, 1.0],
    ],
    c: &[
        &[],
        &[-12.0],
        &[-6.354581592719008, 0.338972550544623],
        &[-8.575016317114033, -7.606483992117508, 12.22499765012482],
        &[-5.888975457523102, -8.15739661784182, 24.805546872612922, 12.79040151279698],
        &[
            -4.408651676063871,
            -6.692003137674639,
            24.625568527593117,
            16.627521966636085,
            -5.714285714285718,
        ],
    ],
    alpha: &[0.0, 0.75, 0.321448134013046, 0.519745732277726, 1.0, 1.0],
    gamma_sum: &[0.25, -0.5, -0.189532918363016, 0.085612108792769, 0.0, 0.0],
    dense: &[
        &[
            -5.323528268423303,
            -10.042123754867493,
            17.175254928256965,
            -5.079931171878093,
            -0.016185991706112,
            0.0,
        ],
        &[
            6.984505741529879,
            6.914061169603662,
            -0.849178943070653,
            18.104410789349338,
            -3.516963011559032,
            0.0,
        ],
    ],
    order: 4,
};

const RODAS5P_LAST: [f64; 5] = [
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
];

/// Eight stages, order 5(4): Steinebach, BIT 63 (2023) 27.
pub(crate) static RODAS5P: Tableau = Tableau {
    gamma: 0.21193756319429014,
    a: &[
        &[],
        &[3.0],
        &[2.849394379747939, 0.45842242204463923],
        &[-6.954028509809101, 2.489845061869568, -10.358996098473584],
        &[2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641],
        &RODAS5P_LAST,
        &[RODAS5P_LAST[0], RODAS5P_LAST[1], RODAS5P_LAST[2], RODAS5P_LAST[3], RODAS5P_LAST[4], 1.0],
        &[
            RODAS5P_LAST[0],
            RODAS5P_LAST[1],
            RODAS5P_LAST[2],
            RODAS5P_LAST[3],
            RODAS5P_LAST[4],
            1.0,
            1.0,
        ],
    ],
    c: &[
        &[],
        &[-14.155112264123755],
        &[-17.97296035885952, -2.859693295451294],
        &[147.12150275711716, -1.41221402718213, 71.68940251302358],
        &[165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306],
        &[
            24.854864614690072,
            -3.0009227002832186,
            47.4931110020768,
            5.5814197821558125,
            -0.6610691825249471,
        ],
        &[
            30.91273214028599,
            -3.1208243349937974,
            77.79954646070892,
            34.28646028294783,
            -19.097331116725623,
            -28.087943162872662,
        ],
        &[
            37.80277123390563,
            -3.2571969029072276,
            112.26918849496327,
            66.9347231244047,
            -40.06618937091002,
            -54.66780262877968,
            -9.48861652309627,
        ],
    ],
    alpha: &[
        0.0,
        0.6358126895828704,
        0.4095798393397535,
        0.9769306725060716,
        0.4288403609558664,
        1.0,
        1.0,
        1.0,
    ],
    gamma_sum: &[
        0.21193756319429014,
        -0.42387512638858027,
        -0.3384627126235924,
        1.8046452872882734,
        2.325825639765069,
        0.0,
        0.0,
        0.0,
    ],
    dense: &[
        &[
            25.948786856663858,
            -2.5579724845846235,
            10.433815404888879,
            -2.3679251022685204,
            0.524948541321073,
            1.1241088310450404,
            0.4272876194431874,
            -0.17202221070155493,
        ],
        &[
            -9.91568850695171,
            -0.9689944594115154,
            3.0438037242978453,
            -24.495224566215796,
            20.176138334709044,
            15.98066361424651,
            -6.789040303419874,
            -6.710236069923372,
        ],
        &[
            11.419903575922262,
            2.8879645146136994,
            72.92137995996029,
            80.12511834622643,
            -52.072871366152654,
            -59.78993625266729,
            -0.15582684282751913,
            4.883087185713722,
        ],
    ],
    order: 5,
};
